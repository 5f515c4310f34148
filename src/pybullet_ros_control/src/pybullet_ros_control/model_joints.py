"""The joints of a model beside the robot: where they are, what drives them, and their stops."""

from collections.abc import Sequence

import numpy as np
import pybullet

from hric_control import urdf
from hric_control.errors import CommandError
from hric_control.geometry import FloatArray
from hric_control.plants import Losses, MovingJoints, PlantConfig, StopLaw, reciprocals
from pybullet_ros_control.engine import Body, Engine
from pybullet_ros_control.joint_dynamics import Vector, added, half_step, make_dynamics


class ModelJoints:
    """The moving joints of one model whose base is fixed. They have the robot's balance, without rotors: their motion
    is of second order, and forces on the links may be given as efforts.

    All vectors are in the engine's order of the joints.

    Args:
        body: loaded, with its joints at zero.
        tree: its description.
        T_world_root: of its root link, shape (4, 4).
        config: the plant's parameters.

    Attributes:
        fixed: whether the base is.
        body: that is loaded now.
        joints: the description's, all of them actuated.
        T_world_base: of the engine's base link, shape (4, 4).
        dynamics: of the model.
        q, dq: the engine's state after the last step.
        at: positions at the measuring instant, which is that of the velocities.
    """

    fixed = True
    _base: tuple[float, ...] = ()
    """Coordinates of the base in the dynamics: any will do."""

    def __init__(
        self, engine: Engine, body: Body, tree: urdf.Robot, T_world_root: FloatArray, config: PlantConfig
    ) -> None:
        assert body.model is not None
        self._engine, self._half = engine, half_step(config)
        names = sorted(body.joints, key=body.joints.__getitem__)
        self.joints = MovingJoints([tree.joints[name] for name in names], names, body.name)
        self.T_world_base = T_world_root @ body.model.T_root_base
        rubs = config.friction == "coulomb"
        self._losses = [
            Losses(coulomb=joint.friction if rubs else 0.0, damping=joint.damping) for joint in self.joints.joints
        ]
        self.dynamics = make_dynamics(
            body.model,
            names,
            self._losses,
            config.gravity,
            config.time_step,
            second_order=config.integrator == "accurate",
            half=self._half,
            T_world_base=self.T_world_base,
            free=not self.fixed,
        )
        self._stops = StopLaw(
            [(joint.lower, joint.upper) for joint in self.joints.joints],
            lambda: reciprocals(self.mobility().diagonal()),
        )
        zeros = self.joints.zeros
        self._start = self.joints.start(zeros, zeros, zeros)
        self.bind(body)
        self.reset()

    def bind(self, body: Body) -> None:
        """The body was loaded again; the state of its joints stays."""
        self.body = body
        self._indices = [body.joints[name] for name in self.joints.names]

    def put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Be at q, dq now and at the start. Raises CommandError where they are not one finite number per joint."""
        zeros = self.joints.zeros
        self._start = self.joints.start(q, zeros if dq is None else dq, zeros)
        self._begin()

    def drive(self, efforts: Sequence[float]) -> None:
        """From the next step on [N m or N]. Raises CommandError where they are not as many as joints."""
        self._driven = self.joints.command(efforts)

    def reset(self) -> None:
        """Be where they were put last, without a drive."""
        self._driven = self.joints.zeros
        self._begin()

    def _begin(self) -> None:
        # The read-out goes half a step back, so the engine starts half a step ahead.
        for joint, x, v in zip(self._indices, *self._start, strict=True):
            pybullet.resetJointState(self.body.id, joint, x + self._half * v, v, physicsClientId=self._engine.client)
        self.refresh()
        self._stops.restart(self._start[0])
        self.dynamics.forget()
        self._held: Vector | None = None

    def hold(self, efforts: Vector) -> None:
        """Efforts of forces on the links in the coming step, which the engine does not get otherwise [N m or N]."""
        self._held = added(self._held, efforts)

    def act(self, external: Vector | None) -> None:
        """Drives, stops and losses of the coming step; external: efforts of forces that the engine got."""
        tau = self._efforts(self._stops.add(self.at, self.dq, self._driven), external)
        pybullet.setJointMotorControlArray(
            self.body.id, self._indices, pybullet.TORQUE_CONTROL, forces=tau, physicsClientId=self._engine.client
        )

    def _efforts(self, tau: list[float], external: Vector | None) -> Vector:
        held, self._held = self._held, None
        if held is None:
            return self.dynamics.torque(self.q, self.dq, tau, external, None)
        return added(held, self.dynamics.torque(self.q, self.dq, tau, added(external, held), None))

    def mobility(self) -> FloatArray:
        """The joints' part of the inverse mass matrix, shape (n, n) [1/(kg m^2)]. The engine's own stays that of an old
        body whose place in memory the model got."""
        q, first = [*self._base, *self.q], len(self._base)
        return np.array(self.dynamics.mobility(q)).reshape(len(q), -1)[first:, first:]

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place."""
        q[:], dq[:] = self.at, self.dq

    def refresh(self) -> None:
        """The state that a step has led to."""
        states = self._engine.joint_states(self.body, self.joints, self._indices)
        self.q, self.dq, self.at, _, _ = self.dynamics.read(states, self.joints.zeros)


class FreeModelJoints(ModelJoints):
    """Those of a model with a free base: of first order, as the engine steps them."""

    fixed = False
    _base = (0.0,) * 6

    def bind(self, body: Body) -> None:
        """The body was loaded again. The engine's motors, which aim at rest, are the Coulomb friction."""
        super().bind(body)
        pybullet.setJointMotorControlArray(
            body.id,
            self._indices,
            pybullet.VELOCITY_CONTROL,
            forces=[loss.coulomb for loss in self._losses],
            physicsClientId=self._engine.client,
        )

    def _efforts(self, tau: list[float], external: Vector | None) -> Vector:
        """Damping at the velocity w that it leaves behind, so that any size of it is stable: w = dq - dt A D w with A
        the joints' part of the inverse mass matrix."""
        damping = np.array([loss.damping for loss in self._losses])
        if not damping.any():
            return tau
        system = np.eye(len(tau)) + self._engine.time_step * self.mobility() * damping
        left: list[float] = (np.array(tau) - damping * np.linalg.solve(system, self.dq)).tolist()
        return left

    def refresh(self) -> None:
        """The state that a step has led to."""
        states = self._engine.joint_states(self.body, self.joints, self._indices)
        self.q, self.dq = [state[0] for state in states], [state[1] for state in states]
        self.at = [x - self._half * v for x, v in zip(self.q, self.dq, strict=True)]


class NoModelJoints:
    """Those of a model of which no joint moves.

    Attributes:
        joints: none.
    """

    def __init__(self, model: str) -> None:
        self.joints, self._model = MovingJoints([], [], model), model

    def read(self, q: list[float], dq: list[float]) -> None:
        """Empty both lists."""
        q[:], dq[:] = (), ()

    def put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Raises CommandError where there is a value."""
        self.drive(q)

    def drive(self, efforts: Sequence[float]) -> None:
        """Raises CommandError where there is one."""
        if len(efforts) > 0:
            raise CommandError(f"got {len(efforts)} values for model {self._model}, of which no joint moves")
