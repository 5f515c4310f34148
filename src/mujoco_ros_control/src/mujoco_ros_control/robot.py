"""Robot in MuJoCo: its joints, their efforts, and one step of the simulation."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from hric_control.plant import FloatArray, JointReaction, Mode
from hric_control.plants import EngineRobot, MovingJoints, WindowlessConfig
from hric_core import urdf
from hric_core.parameters import choice
from mujoco_ros_control.joints import HELD, install_friction, make_joints
from mujoco_ros_control.scene import CompiledScene


@dataclass(frozen=True)
class MujocoConfig(WindowlessConfig):
    """Parameters of the MuJoCo plant: those of all plants, with MuJoCo's choice of integrators."""

    integrator: str = choice(
        "auto",
        "accurate",
        "semi_implicit",
        text="`accurate`: Runge-Kutta of fourth order; `semi_implicit`: MuJoCo's implicitfast; `auto`: `accurate` but "
        "with more than four free objects in the world file",
    )

    @property
    def half_step(self) -> float:
        """Time by which the engine's positions are ahead of its velocities and the measuring instant [s]."""
        return 0.5 * self.time_step if self.integrator == "semi_implicit" and self.half_step_readout else 0.0


class MujocoRobot(EngineRobot):
    """Robot in MuJoCo, the first model of a scene; vectors are in the description's order of the moving joints.

    Args:
        tree: robot description.
        joint_names: names of the actuated joints.
        config: parameters of the plant.

    Attributes:
        names: names of all moving joints in the scene, "model::joint".
    """

    def __init__(self, tree: urdf.Robot, joint_names: Sequence[str], config: MujocoConfig) -> None:
        self._config = config
        moving = [joint for joint in tree.joints.values() if joint.type != "fixed"]
        super().__init__(MovingJoints(moving, joint_names, tree.name), config)
        self._joints = moving
        self.names = [f"{tree.name}::{joint.name}" for joint in moving]
        if config.friction == "identified":
            install_friction()
        self._rotors = [loss.rotor for loss in self.losses]
        self.stepped = False

    # -- the scene -----------------------------------------------------------------------------------------------------

    def bind(self, scene: CompiledScene) -> None:
        """Use a newly compiled scene, in which the robot already has its present state."""
        self._scene, self._m, self._d = scene, scene.m, scene.d
        self.stepped = False
        self._dofs = scene.dofs(self.names)
        self._ids = scene.joint_ids(self.names)
        half, quiet = self._config.half_step, self._divergence.quiet
        self._engine = make_joints(scene.m, scene.d, self._dofs, scene.positions(self.names), self.losses, half, quiet)
        self._read()
        self._send_stops(self.stops.waiting)
        self._send_modes()

    def _read(self) -> None:
        self.q, self.dq, self.at = self._engine.read()

    def put(self, q: Sequence[float], dq: Sequence[float]) -> None:
        """Set positions and velocities of the actuated joints; other joints keep their positions, at rest."""
        self._engine.put(*self.joints.start(q, dq, self.q))
        self._d.qacc_warmstart[:] = 0.0
        self._read()
        self.effort = self.motor_effort = self.joints.zeros
        self._send_stops(self.stops.restart(self.q))

    def _send_stop(self, i: int, low: float, high: float) -> None:
        self._m.jnt_range[self._ids[i]] = low, high

    # -- modes and brakes ----------------------------------------------------------------------------------------------

    def _send_modes(self) -> None:
        """Apply the mode of each moving joint in the engine; a brake that closes stops its joint at once."""
        modes = self._all_modes = self._modes()
        self._held = [i for i, mode in enumerate(modes) if mode is not Mode.EFFORT]
        self._driven = [i for i in self._held if modes[i] is not Mode.BRAKE]
        for i, mode in enumerate(modes):
            self._hold(i, mode is not Mode.EFFORT)
            if mode is Mode.BRAKE:
                self._d.qvel[self._dofs[i]] = 0.0
        led = {i: leader for i, leader, *_ in self.joints.followers}
        self._scene.set_still([dof for i, dof in enumerate(self._dofs) if modes[led.get(i, i)] is Mode.BRAKE])
        self._read()

    def _hold(self, i: int, on: bool) -> None:
        self._m.dof_armature[self._dofs[i]] = HELD if on else self._rotors[i]

    # -- one step ------------------------------------------------------------------------------------------------------

    def step(self, values: list[float], push: Callable[[], None] | None) -> None:
        """Apply the commands, advance the engine, and read the new state.

        Args:
            values: commands of all moving joints; the mode of each joint decides on the quantity.
            push: function that applies forces to bodies, called when their positions and velocities are known; None:
                no forces.
        """
        self.motor_effort = values
        if self._held:
            self._in_stages(values, push)
            quiet = False
        else:
            if push is not None:
                self._engine.prepare()
                push()
            self.q, self.dq, self.at, self.effort, quiet = self._engine.finish(values, push is not None)
        self.stepped = True
        self._check_state(quiet=quiet)

    def _in_stages(self, values: list[float], push: Callable[[], None] | None) -> None:
        """Advance by a step in which some joints are braked or driven; their efforts follow from all other forces."""
        d = self._d
        self._engine.prepare()
        self._engine.write(values)
        for i in self._held:
            d.qfrc_applied[self._dofs[i]] = HELD * self._acceleration(i, values[i])
        if push is not None:
            push()
        self._engine.accelerate()
        beyond = self._cut_drives()
        self._engine.integrate()
        for i in beyond:
            self._hold(i, True)
        if self._held:
            held = self._held_efforts()
            self.motor_effort = [held[i] if i in self._held else x for i, x in enumerate(values)]
        self._read()
        self.effort = self._engine.passed(self.motor_effort)

    def _acceleration(self, i: int, value: float) -> float:
        """Return the acceleration of a braked or driven joint [rad/s^2]; a drive reaches its target in one step."""
        if self._all_modes[i] is Mode.BRAKE:
            return 0.0
        step = self._config.time_step
        if self._all_modes[i] is Mode.POSITION:
            limit = self._joints[i].velocity
            value = min(max((value - self.q[i]) / step, -limit), limit)
        return (value - self.dq[i]) / step

    def _cut_drives(self) -> dict[int, float]:
        """Limit drives to their maximum effort; return the efforts [N m] of the limited ones by joint index."""
        beyond: dict[int, float] = {}
        while self._driven:
            efforts = self._held_efforts()
            excessive = {
                i: math.copysign(self._joints[i].effort, efforts[i])
                for i in self._driven
                if i not in beyond and abs(efforts[i]) > self._joints[i].effort
            }
            if not excessive:
                break
            beyond |= excessive
            for i, effort in excessive.items():
                self._hold(i, False)
                self._d.qfrc_applied[self._dofs[i]] = effort
            self._engine.prepare()
            self._engine.accelerate()
        return beyond

    def _held_efforts(self) -> list[float]:
        """Return the motor efforts that the joints' accelerations need beside all other forces [N m].

        Computed by inverse dynamics.
        """
        m, d = self._m, self._d
        needed = np.empty(m.nv)
        mujoco.mj_rne(m, d, 1, needed)
        projected = d.qfrc_smooth - d.qfrc_passive + d.qfrc_bias - d.qfrc_applied
        rest = (needed - d.qfrc_passive - d.qfrc_constraint - projected)[self._dofs].tolist()
        accelerations = d.qacc[self._dofs].tolist()
        return [x + b * a for x, b, a in zip(rest, self._rotors, accelerations, strict=True)]

    # -- for checks ----------------------------------------------------------------------------------------------------

    def mass_matrix(self) -> FloatArray:
        """Return the engine's mass matrix of all moving joints without rotors, shape (m, m) [kg m^2]."""
        m, d = self._m, self._d
        armature = m.dof_armature.copy()
        m.dof_armature[:] = 0.0
        mujoco.mj_fwdPosition(m, d)
        full = np.empty((m.nv, m.nv))
        mujoco.mj_fullM(m, d, full)
        m.dof_armature[:] = armature
        return full[np.ix_(self._dofs, self._dofs)]

    # -- loads in the joints -------------------------------------------------------------------------------------------

    def reactions(self) -> list[JointReaction]:
        """Return the loads that parent links exert on child links through the moving joints in the last step.

        They belong to the start (semi-implicit integrator) or the end of the step; empty before the first step.
        """
        if not self.stepped:
            return []
        loads = self._engine.loads()
        return [JointReaction(joint.name, joint.child, *load) for joint, load in zip(self._joints, loads, strict=True)]
