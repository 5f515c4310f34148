"""The simulated Franka arm as a RobotHW on any plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.robot_state import RobotMode
from franka_sim import settings
from franka_sim.franka_services import FrankaServices
from franka_sim.modes import Mode, check_one_commander, claimed_mode
from franka_sim.sim_state import SimRobotState
from hric_control import plugins
from hric_control.errors import CommandError
from hric_control.hardware_interface import (
    EffortJointInterface,
    JointCommands,
    JointStateInterface,
    JointStates,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_control.joint_limits import EffortLimiter, LimitCounts, PositionLimiter, VelocityLimiter
from hric_control.node import Node
from hric_control.plant import Plant
from hric_control.robot_hw import ControllerInfo, OnCycle, RobotHW
from hric_control.sim_loop import SimLoop

DEFAULT_PLANT = "pybullet_ros_control/PyBulletPlant"


class FrankaHWSim(RobotHW):
    """Seven joints on a plant, with what the arm's control box does inside: gravity of the arm and of the load it was TOLD, an internal joint
    impedance for position and velocity commands, and a hold at the present pose while nobody commands it.

    Friction is not compensated. The physical payload is the plant's; where it differs from what was told, the arm sags as the real one does.
    Parameters and services: INTERFACE.md.

    Attributes:
        arm_id: prefix of joints and links.
        description: the URDF.
        q_start: pose of the start and of `reset`, 7 floats [rad].
        plant, loop: physics and clock.
        states: joint states at the measuring instant.
        model: what the arm knows of itself.
        robot_state: the Franka state.
        impedance: gains of the internal impedance.
        mode: what the arm is commanded by.
    """

    compensates_gravity = True

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters, build plant and model, put the arm at its start pose."""
        node = robot_hw_node
        self.description = root_node.search_param("robot_description")
        self.arm_id = settings.read_arm_id(node)
        plant_config = settings.read_plant(node, self.arm_id)
        self.model = settings.make_model(node, self.description, self.arm_id, plant_config)
        names = self.joint_names = self.model.joint_names
        self.q_start = settings.read_q_start(node, names)
        limits = settings.read_limits(self.description, root_node, node, self.arm_id, names)
        self.plant: Plant = plugins.find(plugins.PLANT, node.param("plant_type", DEFAULT_PLANT))(self.description, names, plant_config)
        try:
            self.loop = SimLoop(self.plant.time_step, node.param("real_time_factor", 1.0))
            self.rotor_inertia = rotors = settings.read_rotor_inertia(plant_config, names)
            self.impedance = settings.read_impedance(node, self.description, self.model, rotors, self.plant.time_step)
            self._make_storage(limits)
            self._register()
            self._place(self.q_start, self.plant.reset)
            self._services = FrankaServices(self, root_node)
        except BaseException:
            self.plant.close()
            raise

    def _make_storage(self, limits: Sequence[Any]) -> None:
        self.states = states = JointStates(self.joint_names)
        self.robot_state = SimRobotState(states, self.model, self.plant.time_step)
        self.mode = Mode.HOLD
        n = len(states.names)
        self._commands = {mode: JointCommands(states) for mode in (Mode.EFFORT, Mode.VELOCITY, Mode.POSITION)}
        self._kinds = {mode: [mode.value] * n for mode in Mode}
        self._zeros = [0.0] * n
        self._row = self._kinds[Mode.HOLD], self._zeros, self._zeros
        self._q_d, self._dq_d = self._zeros[:], self._zeros[:]
        self._reach = self.impedance.reach()
        self._counts = LimitCounts(states.names, [limit.velocity for limit in limits])
        self._effort_limiter = EffortLimiter(states, self._commands[Mode.EFFORT], limits, self._counts)
        self._velocity_limiter = VelocityLimiter(states, self._commands[Mode.VELOCITY], limits, self._counts)
        self._position_limiter = PositionLimiter(states, self._commands[Mode.POSITION], limits, self._counts)
        self._laws = {Mode.HOLD: self._hold, Mode.EFFORT: self._effort, Mode.VELOCITY: self._velocity, Mode.POSITION: self._position}
        self._law = self._laws[Mode.HOLD]

    def _register(self) -> None:
        self.register_interface(JointStateInterface(self.states))
        self.register_interface(EffortJointInterface(self._commands[Mode.EFFORT]))
        self.register_interface(VelocityJointInterface(self._commands[Mode.VELOCITY]))
        self.register_interface(PositionJointInterface(self._commands[Mode.POSITION]))
        self.register_interface(FrankaStateInterface(self.arm_id, self.robot_state))
        self.register_interface(FrankaModelInterface(self.arm_id, self.model, self.robot_state))

    # -- switching -----------------------------------------------------------------------------------------------------------------------

    def check_for_conflict(self, controllers: Sequence[ControllerInfo]) -> None:
        """One commander at a time, and it claims all seven joints through one interface."""
        super().check_for_conflict(controllers)
        check_one_commander(controllers, self.joint_names)

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """The same for what is to be started."""
        check_one_commander(start, self.joint_names)

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Change the mode at once; without a commander the arm holds where it is."""
        wanted = [mode for info in start if (mode := claimed_mode(info, self.joint_names)) is not Mode.HOLD]
        if wanted:
            self._enter(wanted[0])
        elif any(claimed_mode(info, self.joint_names) is not Mode.HOLD for info in stop):
            self._enter(Mode.HOLD)

    def _enter(self, mode: Mode) -> None:
        """Begin a mode where the arm is: a position command stands at the present pose, velocity and effort at zero."""
        self.mode, self._law = mode, self._laws[mode]
        q = self.states.position
        for kind, start in ((Mode.EFFORT, self._zeros), (Mode.VELOCITY, self._zeros), (Mode.POSITION, q)):
            self._commands[kind].value[:] = start
        self._effort_limiter.reset(self._zeros)
        self._velocity_limiter.reset(self._zeros)
        self._position_limiter.reset(q)
        self._q_d[:], self._dq_d[:] = q, self._zeros
        state = self.robot_state
        state.q_d[:], state.dq_d[:] = q, self._zeros
        state.robot_mode = RobotMode.IDLE if mode is Mode.HOLD else RobotMode.MOVE
        state.control_command_success_rate = 0.0 if mode is Mode.HOLD else 1.0

    # -- the cycle -----------------------------------------------------------------------------------------------------------------------

    def read(self, time: float, period: float) -> None:
        """State of the plant at the measuring instant."""
        states, state = self.states, self.robot_state
        state.tau_before[:] = states.effort
        self.plant.read_state(states.position, states.velocity, states.effort)
        state.time = time
        state.tick += 1

    def write(self, time: float, period: float) -> None:
        """The mode's torque within its limits, plus gravity as far as the arm knows it, to the plant."""
        tau = self._law(period)
        self.robot_state.tau_J_d[:] = tau
        gravity = self.model.gravity_list(self.states.position)
        self.plant.apply([a + b for a, b in zip(tau, gravity, strict=True)])

    def _effort(self, period: float) -> list[float]:
        value = self._commands[Mode.EFFORT].value
        raw = value[:]
        self._effort_limiter.enforce(period)
        self._row = self._kinds[Mode.EFFORT], raw, value[:]
        self.robot_state.q_d[:] = self.states.position
        return value

    def _hold(self, period: float) -> list[float]:
        self._row = self._kinds[Mode.HOLD], self._zeros, self._zeros
        return self._impedance_torque()

    def _position(self, period: float) -> list[float]:
        value, before = self._commands[Mode.POSITION].value, self._q_d
        raw = value[:]
        self._position_limiter.enforce(period)
        self._row = self._kinds[Mode.POSITION], raw, value[:]
        self._dq_d[:] = [(b - a) / period for a, b in zip(before, value, strict=True)]
        before[:] = value
        return self._impedance_torque()

    def _velocity(self, period: float) -> list[float]:
        value = self._commands[Mode.VELOCITY].value
        raw = value[:]
        self._velocity_limiter.enforce(period)
        self._row = self._kinds[Mode.VELOCITY], raw, value[:]
        self._dq_d[:] = value
        # Where the arm cannot follow (contact), the desired position stays within the spring's reach.
        rows = zip(self._q_d, value, self.states.position, self._reach, strict=True)
        self._q_d[:] = [min(max(x_d + v * period, x - reach), x + reach) for x_d, v, x, reach in rows]
        return self._impedance_torque()

    def _impedance_torque(self) -> list[float]:
        states, state = self.states, self.robot_state
        state.q_d[:], state.dq_d[:] = self._q_d, self._dq_d
        return self.impedance.torque(self._q_d, self._dq_d, states.position, states.velocity)

    def run(self, on_cycle: OnCycle) -> None:
        """Read, controllers, write, step; what `on_cycle` answers does not matter to an arm that changes its mode within the cycle."""

        def cycle(time: float, period: float, reset_controllers: bool) -> bool:
            self.read(time, period)
            on_cycle(time, period, reset_controllers)
            self.write(time, period)
            self.plant.step()
            return True

        self.loop.run(cycle)

    def stop(self) -> None:
        """Let `run` return after this cycle; from any thread or a signal handler."""
        self.loop.stop()

    # -- from outside, inside the loop ---------------------------------------------------------------------------------------------------

    def reset(self, q: Sequence[float] | None = None) -> None:
        """Robot to q (its start pose by default) at rest, the world to its start; run time goes on, controllers restart. Inside the loop."""
        self._place(self.q_start if q is None else q, self.plant.reset)
        self.loop.restart_controllers()

    def set_configuration(self, q: Sequence[float]) -> None:
        """Robot to q at rest, the world left as it is, controllers restart. Inside the loop."""
        self._place(q, self.plant.set_configuration)
        self.loop.restart_controllers()

    def _place(self, q: Sequence[float], put: Callable[[Sequence[float]], None]) -> None:
        if len(q) != len(self.joint_names) or not all(map(math.isfinite, q)):
            raise CommandError(f"a pose is {len(self.joint_names)} finite numbers [rad]; got {list(q)}")
        put(q)
        self.plant.read_state(self.states.position, self.states.velocity, self.states.effort)
        self.robot_state.tick += 1
        self._enter(self.mode)
        self._effort_limiter.check_start()

    def tell(self, change: Callable[[KdlFrankaModel], None]) -> None:
        """Change what the arm was told of payload and frames. Inside the loop."""
        change(self.model)
        self.robot_state.take_configuration()

    def limiter_counts(self) -> LimitCounts:
        """What the limits did since the start, over all interfaces."""
        return self._counts

    def log_row(self) -> tuple[list[str], list[float], list[float]]:
        """(command interface per joint, commands before the limits, commands that were sent) of the last cycle."""
        return self._row

    def shutdown(self) -> None:
        """Take the services back and close the plant."""
        self._services.unregister()
        self.plant.close()
