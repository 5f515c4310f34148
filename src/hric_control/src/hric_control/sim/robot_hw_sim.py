"""Simulated RobotHW for any URDF with transmissions, like Gazebo's default robot simulation (DefaultRobotHWSim)."""

from collections.abc import Sequence
from dataclasses import dataclass

from hric_control import limits
from hric_control.hardware_interface import (
    EffortJointInterface,
    JointCommandInterface,
    JointCommands,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_control.pid import Pid, PidGains
from hric_control.plant import DrivenPlant, Mode
from hric_control.robot_hw import ControllerInfo, LogRow
from hric_control.sim.simulated_robot import PlantInput, SimulatedRobot
from hric_control.transmission import parse_transmissions
from hric_core.errors import DescriptionError, HricError, ResourceConflictError
from hric_core.node import Node
from hric_core.parameters import Settings, flag, mapping, number, per_joint

_MODES: dict[type[JointCommandInterface], Mode] = {
    EffortJointInterface: Mode.EFFORT,
    VelocityJointInterface: Mode.VELOCITY,
    PositionJointInterface: Mode.POSITION,
}
_LIMITERS: dict[Mode, type[limits.Limiter]] = {
    Mode.EFFORT: limits.EffortLimiter,
    Mode.VELOCITY: limits.VelocityLimiter,
    Mode.POSITION: limits.PositionLimiter,
}
_BY_CPP_NAME = {kind.cpp_name: mode for kind, mode in _MODES.items()}


@dataclass(frozen=True)
class SimSettings(Settings):
    """Parameters of `RobotHWSim`, in addition to those of its plant."""

    q_start: tuple[float | None, ...] = per_joint(
        number(None, unit="rad or m"),
        {},
        others=None,
        default_text="0, or the position limit next to 0",
        text="`RobotHWSim` only: start pose; a joint outside its range is allowed, with a warning",
    )
    enforce_limits: tuple[str, ...] = limits.ENFORCE_LIMITS
    brake_unclaimed: bool = flag(True, text="`RobotHWSim` only: brake the joints that no controller claims")


class RobotHWSim(SimulatedRobot):
    """Simulated robot whose joints with a transmission can be commanded.

    It has no gravity compensation; joints that no controller claims are braked. The claimed interface defines if the
    command of a joint is an effort, a velocity or a position. A velocity or position is controlled by a PID controller
    with the gains `gazebo_ros_control/pid_gains/<joint>` if they are set, else by the plant's stiff drive. Parameters:
    INTERFACE.md.

    Attributes, in addition to those of `SimulatedRobot`:
        transmissions: transmissions, one per joint, in the order of the joints.
        modes: present command mode of each joint.
    """

    def plant_input(self, root_node: Node, robot_hw_node: Node) -> PlantInput:
        """Read what the robot needs of its plant: the joints are those with a transmission."""
        description = root_node.search_param("robot_description")
        names = [transmission.joint for transmission in parse_transmissions(description)]
        return PlantInput(description, names, mapping(default={}).read(robot_hw_node, "plant"))

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters, construct the plant, and set the robot to its start pose."""
        node = robot_hw_node
        self.description = root_node.search_param("robot_description")
        self.transmissions = parse_transmissions(self.description)
        names = [transmission.joint for transmission in self.transmissions]
        if not names:
            raise DescriptionError(
                "the robot description has no <transmission>, so no joint can be commanded; add one for each actuated "
                "joint"
            )
        settings = SimSettings.read(node, names)
        self._limits = limits.load_limits(self.description, root_node, names, settings.enforce_limits)
        self._refuse_still_joints()
        ranges = limits.load_limits(self.description, None, names, ("position",))
        self.q_start = [
            min(max(0.0, limit.lower), limit.upper) if q is None else q
            for q, limit in zip(settings.q_start, ranges, strict=True)
        ]
        limits.check_start(self.description, names, self.q_start, node.resolve("q_start"))
        self._brakes = [
            settings.brake_unclaimed and set(t.interfaces) != {"JointStateInterface"} for t in self.transmissions
        ]
        self._pids = self._read_pids(root_node, names)
        with self._new_plant(node, self.plant_input(root_node, node)):
            self._check_drives()
            self._make_storage()
            self._put(self.q_start, self._reset_plant)

    def _refuse_still_joints(self) -> None:
        """Refuse limits of 0, which descriptions often have where a value is not known, as no command would act."""
        for limit, transmission in zip(self._limits, self.transmissions, strict=True):
            needed = {"EffortJointInterface": ("velocity", "effort"), "JointStateInterface": ()}
            kinds = {kind for name in transmission.interfaces for kind in needed.get(name, ("velocity",))}
            if still := [kind for kind in sorted(kinds) if getattr(limit, kind) == 0.0]:
                raise DescriptionError(
                    f"joint {limit.name}: its limit of {' and '.join(still)} is 0, so no command can move it; valid: "
                    f"above 0, in its <limit> or in joint_limits/{limit.name}"
                )

    def _read_pids(self, root_node: Node, names: Sequence[str]) -> dict[int, Pid]:
        where = "gazebo_ros_control/pid_gains"
        gains = mapping(default={}).read(root_node, where)
        return {
            i: Pid(PidGains.of(gains[name], root_node.resolve(f"{where}/{name}")), self._limits[i].effort)
            for i, name in enumerate(names)
            if name in gains
        }

    def _check_drives(self) -> None:
        if isinstance(self.plant, DrivenPlant):
            return
        for i, transmission in enumerate(self.transmissions):
            kinds = [
                name for name in transmission.interfaces if name in ("VelocityJointInterface", "PositionJointInterface")
            ]
            if kinds and i not in self._pids:
                raise HricError(
                    f"joint {transmission.joint} offers {', '.join(kinds)}, but {type(self.plant).__name__} has no "
                    f"velocity or position drives: set the gains gazebo_ros_control/pid_gains/{transmission.joint}"
                )

    def _make_storage(self) -> None:
        states = self.states
        self.register_interface(JointStateInterface(states))
        self._counts = limits.LimitCounts(states.names, [limit.velocity for limit in self._limits])
        self._commands: dict[Mode, JointCommands] = {}
        self._limiters: dict[Mode, limits.Limiter] = {}
        for kind, mode in _MODES.items():
            offered = [t.joint for t in self.transmissions if kind.__name__ in t.interfaces]
            if offered:
                commands = self._commands[mode] = JointCommands(states)
                self._limiters[mode] = _LIMITERS[mode](states, commands, self._limits, self._counts)
                self.register_interface(kind(commands, offered))
        n = len(states.names)
        self._raw, self._sent = [0.0] * n, [0.0] * n
        self._claimed: dict[str, Mode] = {}
        self._plant_modes = [Mode.EFFORT] * n
        self._take_modes()

    # -- switching -----------------------------------------------------------------------------------------------------

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Refuse a controller that commands a joint through two interfaces."""
        for info in start:
            seen: dict[str, str] = {}
            for interface, joints in info.claims.items():
                for joint in joints if interface in _BY_CPP_NAME else ():
                    if joint in seen:
                        raise ResourceConflictError(
                            f"{info.name} claims {joint} through both {seen[joint]} and {interface}"
                        )
                    seen[joint] = interface

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Set each joint to the command mode of the interface that claims it; a joint whose mode changes first rests.

        Joints of other robots, in claims of a controller of several robots, are ignored.
        """
        before, own = dict(self._claimed), self.states.index
        for info in stop:
            for joint in _claimed(info):
                self._claimed.pop(joint, None)
        started = {joint: mode for info in start for joint, mode in _claimed(info).items() if joint in own}
        self._claimed |= started
        for joint in started.keys() | {
            joint for joint in {*before, *self._claimed} if before.get(joint) != self._claimed.get(joint)
        }:
            self._stay(self.states.index[joint])
        self._take_modes()

    def _stay(self, i: int) -> None:
        for mode, commands in self._commands.items():
            commands.value[i] = self.states.position[i] if mode is Mode.POSITION else 0.0
        if i in self._pids:
            self._pids[i].reset()

    def _take_modes(self) -> None:
        """Pass the command mode of each joint to the limiters and the plant."""
        self.modes = [self._claimed.get(name, Mode.BRAKE) for name in self.states.names]
        self._all_effort = all(mode is Mode.EFFORT for mode in self.modes)
        self._kinds = ["none" if mode is Mode.BRAKE else mode.value for mode in self.modes]
        self._active: list[limits.Limiter] = []
        for mode, limiter in self._limiters.items():
            joints = [name for name, now in zip(self.states.names, self.modes, strict=True) if now is mode]
            limiter.select(joints)
            if joints:
                self._active.append(limiter)
        plant_modes: list[Mode] = [
            Mode.EFFORT if mode is Mode.BRAKE or i in self._pids else mode for i, mode in enumerate(self.modes)
        ]
        if plant_modes != self._plant_modes and isinstance(self.plant, DrivenPlant):
            self.plant.set_modes(plant_modes)
        self._plant_modes = plant_modes
        self.plant.set_brakes(
            [brake and mode is Mode.BRAKE for brake, mode in zip(self._brakes, self.modes, strict=True)]
        )

    # -- the cycle -----------------------------------------------------------------------------------------------------

    def write(self, time: float, period: float) -> None:
        """Limit the commands, then pass them to the plant."""
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
        """Return the present command of each joint; zero for a joint that no controller claims."""
        return [0.0 if mode is Mode.BRAKE else self._commands[mode].value[i] for i, mode in enumerate(self.modes)]

    def _settle(self, q: Sequence[float]) -> None:
        self.read(0.0, 0.0)
        for i in range(len(q)):
            self._stay(i)
        for limiter in self._limiters.values():
            limiter.reset()
        for limiter in list(self._limiters.values())[:1]:  # one is enough, as the counts are shared
            limiter.check_start()

    # -- values for logs and topics ------------------------------------------------------------------------------------

    def limiter_counts(self) -> limits.LimitCounts:
        """Return the counts of limited commands since the start, over all interfaces."""
        return self._counts

    def log_row(self) -> LogRow:
        """Return the commands of the last cycle, for the control log."""
        return self._kinds, self._raw, self._sent

    def actuator_states(self) -> dict[str, tuple[float, float, float]]:
        """Return (position [rad or m], velocity, effort) of each actuator by name, computed from its joint's state."""
        result, motors = {}, self.plant.motor_effort()
        for i, transmission in enumerate(self.transmissions):
            result[transmission.actuator] = (
                transmission.joint_to_actuator_position(self.states.position[i]),
                transmission.joint_to_actuator_velocity(self.states.velocity[i]),
                transmission.joint_to_actuator_effort(motors[i]),
            )
        return result


def _claimed(info: ControllerInfo) -> dict[str, Mode]:
    return {
        joint: _BY_CPP_NAME[interface]
        for interface, joints in info.claims.items()
        if interface in _BY_CPP_NAME
        for joint in joints
    }
