"""Any robot with transmissions as a RobotHW on a physics plant, as Gazebo's default robot simulation offers it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from hric_control import plugins
from hric_control.errors import CommandError, DescriptionError, HricError, ResourceConflictError
from hric_control.hardware_interface import (
    JOINT_COMMAND_INTERFACES,
    EffortJointInterface,
    JointCommandInterface,
    JointCommands,
    JointStateInterface,
    JointStates,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_control.joint_limits import EffortLimiter, LimitCounts, PositionLimiter, VelocityLimiter, load_limits
from hric_control.node import Node
from hric_control.plant import Plant
from hric_control.plants.config import DEFAULTS, rotor_inertia
from hric_control.plants.modes import DrivenPlant, Mode
from hric_control.robot_hw import ControllerInfo, OnCycle, RobotHW
from hric_control.sim_loop import SimLoop
from hric_control.transmission import parse_transmissions
from pybullet_ros_control import robot_settings
from pybullet_ros_control.pid import Pid, PidGains

DEFAULT_PLANT = "pybullet_ros_control/PyBulletPlant"
_MODES: dict[type[JointCommandInterface], Mode] = {
    EffortJointInterface: Mode.EFFORT,
    VelocityJointInterface: Mode.VELOCITY,
    PositionJointInterface: Mode.POSITION,
}
AnyLimiter = EffortLimiter | VelocityLimiter | PositionLimiter
_LIMITERS: dict[Mode, type[AnyLimiter]] = {
    Mode.EFFORT: EffortLimiter,
    Mode.VELOCITY: VelocityLimiter,
    Mode.POSITION: PositionLimiter,
}
_BY_CPP_NAME = {kind.cpp_name: _MODES[kind] for kind in JOINT_COMMAND_INTERFACES}


class RobotHWSim(RobotHW):
    """The joints that have a transmission, on a plant. Gravity is not compensated; joints that nobody claims are braked. Parameters: INTERFACE.md.

    A command of a joint is what its interface says; a position or velocity is reached by `gazebo_ros_control/pid_gains/<joint>` where they are given,
    by the plant's stiff drive otherwise.

    Attributes:
        description: the URDF.
        transmissions: one per joint, in the order of the joints.
        q_start: where `reset` puts the robot, n floats [rad or m].
        plant, loop: physics and clock.
        states: joint states at the measuring instant.
        modes: what each joint is commanded by now.
        rotor_inertia: of each joint, which a controller needs to judge its gains [kg m^2].
    """

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters, build the plant, put the robot at its start."""
        node = robot_hw_node
        self.description: str = root_node.search_param("robot_description")
        self.transmissions = parse_transmissions(self.description)
        names = [transmission.joint for transmission in self.transmissions]
        if not names:
            raise DescriptionError("the robot description has no transmission: no joint can be commanded")
        self._limits = load_limits(self.description, root_node, names, robot_settings.limit_kinds(node))
        self.q_start = robot_settings.q_start(node, names, load_limits(self.description, None, names, ("position",)))
        brakes = robot_settings.flag(node, "brake_unclaimed", True)
        config = robot_settings.mapping(node, "plant")
        self._brakes = [brakes and set(t.interfaces) != {"JointStateInterface"} for t in self.transmissions]
        self.rotor_inertia = rotor_inertia(config.get("rotor_inertia", DEFAULTS["rotor_inertia"]), names)
        self._pids = self._read_pids(root_node, names)
        self.plant: Plant = plugins.find(plugins.PLANT, node.param("plant_type", DEFAULT_PLANT))(self.description, names, config)
        try:
            self._check_drives()
            self.loop = SimLoop(self.plant.time_step, node.param("real_time_factor", 1.0))
            self._make_storage(names)
            self._place(self.q_start, self.plant.reset)
        except BaseException:
            self.plant.close()
            raise

    def _read_pids(self, root_node: Node, names: Sequence[str]) -> dict[int, Pid]:
        pids = {}
        for i, name in enumerate(names):
            key = f"gazebo_ros_control/pid_gains/{name}"
            if root_node.has_param(key):
                pids[i] = Pid(PidGains.from_parameter(root_node.param(key), root_node.resolve(key)), self._limits[i].effort)
        return pids

    def _check_drives(self) -> None:
        if isinstance(self.plant, DrivenPlant):
            return
        for i, transmission in enumerate(self.transmissions):
            kinds = [name for name in transmission.interfaces if name in ("VelocityJointInterface", "PositionJointInterface")]
            if kinds and i not in self._pids:
                raise HricError(
                    f"joint {transmission.joint} offers {', '.join(kinds)}, but {type(self.plant).__name__} has no drives: "
                    f"give gazebo_ros_control/pid_gains/{transmission.joint}"
                )

    def _make_storage(self, names: Sequence[str]) -> None:
        self.states = states = JointStates(names)
        self.register_interface(JointStateInterface(states))
        self._counts = LimitCounts(states.names, [limit.velocity for limit in self._limits])
        self._commands: dict[Mode, JointCommands] = {}
        self._limiters: dict[Mode, AnyLimiter] = {}
        for kind, mode in _MODES.items():
            offered = [t.joint for t in self.transmissions if kind.__name__ in t.interfaces]
            if offered:
                commands = self._commands[mode] = JointCommands(states)
                self._limiters[mode] = _LIMITERS[mode](states, commands, self._limits, self._counts)
                self.register_interface(kind(commands, offered))
        self._zeros = [0.0] * len(names)
        self._raw, self._sent = self._zeros[:], self._zeros[:]
        self._claimed: dict[str, Mode] = {}
        self._plant_modes = [Mode.EFFORT] * len(names)
        self._take_modes()

    # -- switching -----------------------------------------------------------------------------------------------------------------------

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """A joint can be commanded through one interface at a time."""
        for info in start:
            seen: dict[str, str] = {}
            for interface, joints in info.claims.items():
                for joint in joints if interface in _BY_CPP_NAME else ():
                    if joint in seen:
                        raise ResourceConflictError(f"{info.name} claims {joint} through both {seen[joint]} and {interface}")
                    seen[joint] = interface

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Give each joint the mode of the interface by which it is claimed; a joint that changes starts with the command to stay."""
        before = dict(self._claimed)
        for info in stop:
            for joint in _claimed(info):
                self._claimed.pop(joint, None)
        for info in start:
            self._claimed.update(_claimed(info))
        started = {joint for info in start for joint in _claimed(info)}
        for joint in started | {joint for joint in {*before, *self._claimed} if before.get(joint) != self._claimed.get(joint)}:
            self._stay(self.states.index[joint])
        self._take_modes()

    def _stay(self, i: int) -> None:
        for mode, commands in self._commands.items():
            commands.value[i] = self.states.position[i] if mode is Mode.POSITION else 0.0
        if i in self._pids:
            self._pids[i].reset()

    def _take_modes(self) -> None:
        """Tell limiters and plant what each joint is now."""
        self.modes = [self._claimed.get(name, Mode.BRAKE) for name in self.states.names]
        self._all_effort = all(mode is Mode.EFFORT for mode in self.modes)
        self._kinds = ["none" if mode is Mode.BRAKE else mode.value for mode in self.modes]
        self._active: list[AnyLimiter] = []
        for mode, limiter in self._limiters.items():
            joints = [name for name, now in zip(self.states.names, self.modes, strict=True) if now is mode]
            limiter.select(joints)
            if joints:
                self._active.append(limiter)
        wanted: list[Mode] = [Mode.EFFORT if mode is Mode.BRAKE or i in self._pids else mode for i, mode in enumerate(self.modes)]
        if wanted != self._plant_modes and isinstance(self.plant, DrivenPlant):
            self.plant.set_modes(wanted)
        self._plant_modes = wanted
        self.plant.set_brakes([brake and mode is Mode.BRAKE for brake, mode in zip(self._brakes, self.modes, strict=True)])

    # -- the cycle -----------------------------------------------------------------------------------------------------------------------

    def read(self, time: float, period: float) -> None:
        """State of the plant at the measuring instant."""
        states = self.states
        self.plant.read_state(states.position, states.velocity, states.effort)

    def write(self, time: float, period: float) -> None:
        """Limits, then the commands to the plant."""
        if not self._all_effort:
            self._write_mixed(period)
            return
        value = self._commands[Mode.EFFORT].value
        self._raw = value[:]
        self._limiters[Mode.EFFORT].enforce(period)
        self._sent = value
        self.plant.apply(value)

    def _write_mixed(self, period: float) -> None:
        self._raw = self._gather()
        cycles = self._counts.cycles
        for limiter in self._active:
            limiter.enforce(period)
        self._counts.cycles = cycles + bool(self._active)
        self._sent = self._gather()
        values = self._sent[:]
        for i, pid in self._pids.items():
            if self.modes[i] is Mode.POSITION:
                values[i] = pid.effort(values[i] - self.states.position[i], period)
            elif self.modes[i] is Mode.VELOCITY:
                values[i] = pid.effort(values[i] - self.states.velocity[i], period)
        self.plant.apply(values)

    def _gather(self) -> list[float]:
        """The command in force of each joint, zero for one that nobody claims."""
        return [0.0 if mode is Mode.BRAKE else self._commands[mode].value[i] for i, mode in enumerate(self.modes)]

    def run(self, on_cycle: OnCycle) -> None:
        """Read, controllers, write, step. A switch needs no other mode of the robot, so the answer of `on_cycle` does not matter."""

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
        """Robot to q (its start by default) at rest, the world to its start; run time goes on, controllers restart. Inside the loop."""
        self._place(self.q_start if q is None else q, self.plant.reset)
        self.loop.restart_controllers()

    def set_configuration(self, q: Sequence[float]) -> None:
        """Robot to q at rest, the world left as it is, controllers restart. Inside the loop."""
        self._place(q, self.plant.set_configuration)
        self.loop.restart_controllers()

    def _place(self, q: Sequence[float], put: Callable[[Sequence[float]], None]) -> None:
        if len(q) != len(self.states.names) or not all(map(math.isfinite, q)):
            raise CommandError(f"a pose is {len(self.states.names)} finite numbers for {', '.join(self.states.names)}; got {list(q)}")
        put(q)
        self.read(0.0, 0.0)
        for i in range(len(q)):
            self._stay(i)
        for limiter in self._limiters.values():
            limiter.reset()
        for limiter in list(self._limiters.values())[:1]:  # the counts are shared: one tells for all
            limiter.check_start()

    # -- what others ask -----------------------------------------------------------------------------------------------------------------

    def limiter_counts(self) -> LimitCounts:
        """What the limits did since the start, over all interfaces."""
        return self._counts

    def log_row(self) -> tuple[list[str], list[float], list[float]]:
        """(command interface per joint, commands before the limits, commands that were sent) of the last cycle."""
        return self._kinds, self._raw, self._sent

    def actuator_states(self) -> dict[str, tuple[float, float, float]]:
        """(position [rad or m], velocity, effort) of each actuator by name, through its transmission."""
        result, motors = {}, self.plant.motor_effort()
        for i, transmission in enumerate(self.transmissions):
            side = transmission.mapping()
            result[transmission.actuator] = (
                side.joint_to_actuator_position(self.states.position[i]),
                side.joint_to_actuator_velocity(self.states.velocity[i]),
                side.joint_to_actuator_effort(motors[i]),
            )
        return result

    def shutdown(self) -> None:
        """Release the plant."""
        self.plant.close()


def _claimed(info: ControllerInfo) -> dict[str, Mode]:
    return {joint: _BY_CPP_NAME[interface] for interface, joints in info.claims.items() if interface in _BY_CPP_NAME for joint in joints}
