"""Joints of the models around the robot (e.g. a human body): their positions, drives and stops in PyBullet."""

from collections.abc import Sequence

import numpy as np
import pybullet

from hric_control.plants import DrivenJoints, PlantConfig, reciprocals
from hric_core import urdf
from hric_core.geometry import FloatArray
from pybullet_ros_control.engine import LoadedBody, PhysicsClient
from pybullet_ros_control.joint_dynamics import Vector, added, half_step, make_dynamics


class PybulletModelJoints(DrivenJoints):
    """Moving joints of one model with a fixed base, in the engine's order.

    They use the same joint dynamics as the robot's, without rotors: the step is second-order accurate, and forces on
    links can be passed as joint efforts.

    Args:
        engine: engine with the body.
        body: loaded body, with its joints at zero.
        tree: description of the model.
        T_world_root: pose of the root link, shape (4, 4).
        config: parameters of the plant.

    Attributes:
        fixed: True if the base is fixed.
        body: present body in the engine.
        T_world_base: pose of the engine's base link, shape (4, 4).
        dynamics: compiled joint dynamics of the model.
        q, dq: the engine's joint positions and velocities after the last step.
        at: positions at the measuring instant, to which the velocities also belong.
    """

    fixed = True
    _base: tuple[float, ...] = ()
    """Placeholder for the coordinates of a free base, whose values have no effect on the result."""

    def __init__(
        self, engine: PhysicsClient, body: LoadedBody, tree: urdf.Robot, T_world_root: FloatArray, config: PlantConfig
    ) -> None:
        assert body.model is not None
        self._engine, self._half = engine, half_step(config)
        names = sorted(body.joints, key=body.joints.__getitem__)
        super().__init__(body.name, [tree.joints[name] for name in names], config)
        self.T_world_base = T_world_root @ body.model.T_root_base
        self.dynamics = make_dynamics(
            body.model,
            names,
            self.losses,
            config.gravity,
            config.time_step,
            second_order=config.integrator == "accurate",
            half=self._half,
            T_world_base=self.T_world_base,
            free=not self.fixed,
        )
        self.bind(body)
        self.reset()

    def bind(self, body: LoadedBody) -> None:
        """Connect to the body after it was loaded again; the stored joint states stay."""
        self.body = body
        self._indices = [body.joints[name] for name in self.joints.names]

    def _inertias(self) -> Sequence[float]:
        return reciprocals(self.mobility().diagonal())

    def begin(self) -> None:
        """Set the joints in the engine to the stored start positions and velocities."""
        # The read-out subtracts half a step, so the engine starts half a step ahead.
        for joint, x, v in zip(self._indices, *self._start, strict=True):
            pybullet.resetJointState(self.body.id, joint, x + self._half * v, v, physicsClientId=self._engine.client)
        self.refresh()
        self._stops.restart(self._start[0])
        self.dynamics.forget()
        self._held: Vector | None = None

    def hold(self, efforts: Vector) -> None:
        """Add joint efforts [N m or N] for the coming step that are equivalent to forces on links, e.g. of bushings."""
        self._held = added(self._held, efforts)

    def act(self, external: Vector | None) -> None:
        """Send the joint efforts of the coming step to the engine: drives, stops, damping and friction.

        external: joint efforts of forces that the engine already has [N m or N]; None: no forces.
        """
        tau = self._balanced(self._stops.add(self.at, self.dq, self._efforts), external)
        pybullet.setJointMotorControlArray(
            self.body.id, self._indices, pybullet.TORQUE_CONTROL, forces=tau, physicsClientId=self._engine.client
        )

    def _balanced(self, tau: list[float], external: Vector | None) -> Vector:
        held, self._held = self._held, None
        if held is None:
            return self.dynamics.torque(self.q, self.dq, tau, external, None)
        return added(held, self.dynamics.torque(self.q, self.dq, tau, added(external, held), None))

    def mobility(self) -> FloatArray:
        """Return the joints' part of the inverse mass matrix, shape (n, n) [1/(kg m^2)].

        PyBullet's own mass matrix is not used: after a body was deleted, it may be that of the old body.
        """
        q, first = [*self._base, *self.q], len(self._base)
        return np.array(self.dynamics.mobility(q)).reshape(len(q), -1)[first:, first:]

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write joint positions and velocities at the measuring instant into the lists q and dq."""
        q[:], dq[:] = self.at, self.dq

    def refresh(self) -> None:
        """Read the joint states from the engine after a step."""
        states = self._engine.joint_states(self.body, self.joints, self._indices)
        self.q, self.dq, self.at, _, _ = self.dynamics.read(states, self.joints.zeros)


class FreeModelJoints(PybulletModelJoints):
    """Moving joints of a model with a free base; the step is first-order accurate, as PyBullet's own."""

    fixed = False
    _base = (0.0,) * 6

    def bind(self, body: LoadedBody) -> None:
        """Connect to the body after it was loaded again; motors of the engine at zero speed model Coulomb friction."""
        super().bind(body)
        pybullet.setJointMotorControlArray(
            body.id,
            self._indices,
            pybullet.VELOCITY_CONTROL,
            forces=[loss.coulomb for loss in self.losses],
            physicsClientId=self._engine.client,
        )

    def _balanced(self, tau: list[float], external: Vector | None) -> Vector:
        """Return the efforts less the damping D w at the end of the step, so that damping of any size is stable.

        w = dq - dt A D w, with A the joints' part of the inverse mass matrix.
        """
        damping = np.array([loss.damping for loss in self.losses])
        if not damping.any():
            return tau
        system = np.eye(len(tau)) + self._engine.time_step * self.mobility() * damping
        left: list[float] = (np.array(tau) - damping * np.linalg.solve(system, self.dq)).tolist()
        return left

    def refresh(self) -> None:
        """Read the joint states from the engine after a step."""
        states = self._engine.joint_states(self.body, self.joints, self._indices)
        self.q, self.dq = [state[0] for state in states], [state[1] for state in states]
        self.at = [x - self._half * v for x, v in zip(self.q, self.dq, strict=True)]
