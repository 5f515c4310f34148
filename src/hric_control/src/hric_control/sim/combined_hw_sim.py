"""Several simulated robots in one plant, as one RobotHW: two arms on a table, with one world, one clock and one log."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain
from typing import Any

from hric_control.hardware_interface import (
    EffortJointInterface,
    HardwareInterface,
    JointCommandInterface,
    JointCommands,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_control.limits import LimitCounts
from hric_control.plant import DEFAULT_PLANT
from hric_control.plants import PHI, rotor_inertia
from hric_control.robot_app import RobotApp
from hric_control.robot_hw import ControllerInfo, LogRow, OnCycle
from hric_control.robot_settings import new_robot_hw
from hric_control.sim.shared_plant import SharedPlant
from hric_control.sim.simulated_robot import PlantInput, SimulatedRobot
from hric_control.speed_scale import SpeedScaleInterface
from hric_core.errors import HricError, ParameterError
from hric_core.node import Node
from hric_core.parameters import Settings, either, mapping, names
from hric_core.urdf import read
from hric_core.urdf.combining import combined

MODEL = "arms"
"""Name of the model of all robots in the plant, the first part of "arms::left_link7"."""
PRIVATE = "robot"
"""Private namespace of a robot's parameters, below the robot's own namespace."""
IDENTIFIED = "identified"
"""Friction of the plant with parameters by joint."""
BY_JOINT = "friction_parameters"
"""Parameter of the plant that is combined by joint, as is the rotor inertia."""

JOINT_COMMANDS = (EffortJointInterface, VelocityJointInterface, PositionJointInterface)


@dataclass(frozen=True)
class CombinedSettings(Settings):
    """Parameters of `CombinedHWSim`."""

    arms: tuple[str, ...] | Mapping[str, Mapping[str, object]] = either(
        mapping(mapping()),
        names(),
        text="`CombinedHWSim` only: names of the combined robots; the namespace of each has its `robot_description`, "
        "its controllers, and as `robot/...` the parameters of its type. A mapping also sets these namespaces",
    )


@dataclass(frozen=True)
class _Route:
    """Path of joint commands from controllers of the combination to one robot.

    Attributes:
        robot: the robot.
        combined: commands of all joints.
        own: commands of the robot's joints.
        span: indices of the robot's joints in `combined`.
    """

    robot: SimulatedRobot
    combined: JointCommands
    own: JointCommands
    span: slice

    def fetch(self) -> None:
        """Copy the robot's present commands to the combination."""
        self.combined.value[self.span] = self.own.value

    def deliver(self) -> None:
        """Copy the combination's commands to the robot."""
        self.own.value[:] = self.combined.value[self.span]


class CombinedHWSim(SimulatedRobot):
    """Several simulated robots in one plant, each with its own controller manager in its own namespace.

    Comparable to `combined_robot_hw` of ros_control. The joints of this RobotHW are those of all robots, in order; its
    own controllers can read and command them, and are updated before those of the robots. One loop reads all robots,
    updates all controllers, writes all commands, and steps the plant once. The speed scale is common to all robots.

    Attributes, in addition to those of `SimulatedRobot`:
        compensates_gravity: True if one of the robots adds gravity torques to effort commands.
    """

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters, construct the plant of all robots, and then the robots."""
        self.description = root_node.search_param("robot_description")
        nodes = robot_nodes(root_node, robot_hw_node)
        self._robots = {name: self._new_robot(*pair) for name, pair in nodes.items()}
        needed = {name: robot.plant_input(*nodes[name]) for name, robot in self._robots.items()}
        engines = {name: private.param("plant_type", DEFAULT_PLANT) for name, (_, private) in nodes.items()}
        plant = combined_input(needed)
        robot_hw_node.set_param("plant_type", common("plant_type", engines))
        robot_hw_node.set_param("plant", dict(plant.config))  # for the record of the run
        self._kinds: tuple[list[str], tuple[Sequence[str], ...]] = ([], ())
        with self._new_plant(robot_hw_node, plant), ExitStack() as opened:
            self._shared = SharedPlant(self.plant)
            for name, pair in nodes.items():
                self._robots[name].shared, self._robots[name].loop = self._shared, self.loop
                pair[1].set_param("control_log", False)
                app = RobotApp(*pair, hw=self._robots[name], live=not root_node.publishes_inline)
                opened.callback(app.shutdown)
                self.apps[name] = app
            self._opened = opened.pop_all()
            self.q_start = [value for robot in self._robots.values() for value in robot.q_start]
            self.register_interface(JointStateInterface(self.states))
            self._offer_commands()
            self._offer_others()
            self._put(self.q_start, self._reset_plant)

    def _new_robot(self, root_node: Node, private: Node) -> SimulatedRobot:
        name, robot = new_robot_hw(root_node, private)
        if not isinstance(robot, SimulatedRobot):
            raise HricError(f"{name} at {root_node.namespace} is not simulated; valid: simulated robots in one plant")
        robot.get(SpeedScaleInterface).scale = robot.speed_scale = self.speed_scale
        return robot

    # -- controllers of several robots ---------------------------------------------------------------------------------

    def _offer_commands(self) -> None:
        """Register the command interfaces of all joints that have one in their robot."""
        index = self.states.index
        self._spans = {
            robot: slice(index[robot.states.names[0]], index[robot.states.names[-1]] + 1)
            for robot in self._robots.values()
        }
        compensating = {robot.compensates_gravity for robot in self._robots.values()}
        self.compensates_gravity = any(compensating)
        self._controllers: dict[str, ControllerInfo] = {}
        self._routes: list[_Route] = []
        self._offered: list[JointCommandInterface] = []
        for kind in JOINT_COMMANDS:
            if kind is EffortJointInterface and len(compensating) > 1:
                continue  # no setting of gravity suits all robots
            names = [name for robot in self._robots.values() if robot.has(kind) for name in robot.get(kind).names]
            if names:
                self._offered.append(kind(JointCommands(self.states), names))
                self.register_interface(self._offered[-1])

    def _offer_others(self) -> None:
        """Register the other interfaces, such as state and model of each arm, with the resources of all robots."""
        parts: dict[type[HardwareInterface], list[HardwareInterface]] = {}
        for robot in self._robots.values():
            for interface in robot.interfaces():
                if not self.has(type(interface)):
                    parts.setdefault(type(interface), []).append(interface)
        for first, *others in parts.values():
            whole = first.joined(others)
            if whole is not None:
                self.register_interface(whole)

    def check_for_conflict(self, controllers: Sequence[ControllerInfo]) -> None:
        """Refuse controllers that must not run together in one of the robots."""
        for robot in self._robots.values():
            robot.check_for_conflict(controllers)

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Check with each robot that a switch of controllers is possible."""
        for robot in self._robots.values():
            robot.prepare_switch(start, stop)

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Change the command modes of the robots whose joints are claimed or released."""
        for robot in self._robots.values():
            robot.do_switch(start, stop)
        for info in stop:
            self._controllers.pop(info.name, None)
        self._controllers |= {info.name: info for info in start}
        self._routes = [
            _Route(robot, offered.commands, robot.get(type(offered)).commands, span)
            for offered in self._offered
            for robot, span in self._spans.items()
            if robot.has(type(offered)) and not self._claimed(offered).isdisjoint(robot.states.names)
        ]
        for route in self._routes:
            route.fetch()

    def _claimed(self, offered: JointCommandInterface) -> set[str]:
        return {name for info in self._controllers.values() for name in info.claims.get(offered.cpp_name, ())}

    def switch_done(self, start: Sequence[ControllerInfo]) -> bool:
        """Return True if each robot is ready for the commands of these controllers."""
        return all([robot.switch_done(start) for robot in self._robots.values()])

    def _halt_with_others(self) -> None:
        """Halt robots that share a controller with one in an error state, as franka_ros does; release the others."""
        halted: set[SimulatedRobot] = set()
        for info in self._controllers.values():
            claimed = frozenset[str]().union(*info.claims.values())
            shared = [
                robot
                for robot in self._robots.values()
                if any(not claimed.isdisjoint(part.names) for part in robot.interfaces() if part.claims_resources)
            ]
            if any(robot.error for robot in shared):
                halted |= {*shared}
        for robot in self._robots.values():
            robot.halted = robot in halted

    # -- the cycle -----------------------------------------------------------------------------------------------------

    def read(self, time: float, period: float) -> None:
        """Read the state of all joints from the plant once; then let each robot read its own, with its noise."""
        self._shared.read()
        for robot in self._robots.values():
            robot.read(time, period)
        self._gather()

    def _gather(self) -> None:
        parts, states = [robot.states for robot in self._robots.values()], self.states
        states.position[:] = chain.from_iterable(part.position for part in parts)
        states.velocity[:] = chain.from_iterable(part.velocity for part in parts)
        states.effort[:] = chain.from_iterable(part.effort for part in parts)

    def _also_of_robots(self, on_cycle: OnCycle) -> OnCycle:
        """Return a callback that also updates the controllers of each robot."""
        robots = [(self._robots[name], app.on_cycle) for name, app in self.apps.items()]

        def all_cycles(time: float, period: float, reset_controllers: bool) -> bool:
            if self.error:
                self._halt_with_others()
            restarts = {robot: robot.begin() for robot, _ in robots}
            for route in self._routes:
                route.fetch()
            restarting = any(restarts[route.robot] for route in self._routes)
            on_cycle(time, period, reset_controllers or restarting)
            for route in self._routes:  # those after a switch in `on_cycle`
                route.deliver()
            for robot, cycle in robots:
                cycle(time, period, reset_controllers or restarts[robot])
            return True

        return all_cycles

    def run(self, on_cycle: OnCycle) -> None:
        """Run cycles: read all robots, update all controllers, write all commands, step the plant."""
        managers = [app.manager for app in self.apps.values()]
        before = [manager.loop_running for manager in managers]
        for manager in managers:
            manager.loop_running = True
        try:
            super().run(self._also_of_robots(on_cycle))
        finally:
            for manager, running in zip(managers, before, strict=True):
                manager.loop_running = running

    def write(self, time: float, period: float) -> None:
        """Let each robot write its commands, and pass those of all joints to the plant."""
        failed = False
        for robot in self._robots.values():
            robot.write(time, period)
            failed = failed or bool(robot.error)
        if failed or self.error:
            self.error = "; ".join(f"{name}: {robot.error}" for name, robot in self._robots.items() if robot.error)
        self.plant.apply(self._shared.command)

    def _reset_plant(self, q: Sequence[float]) -> None:
        super()._reset_plant(q)
        self._shared.read()
        for robot, span in self._spans.items():
            robot._reset_plant(q[span])

    def _settle(self, q: Sequence[float]) -> None:
        self._shared.read()
        for robot, span in self._spans.items():
            robot._settle(q[span])
        self._gather()
        self.error = ""

    def shutdown(self) -> None:
        """Release the robots, and then the plant."""
        self._opened.close()
        super().shutdown()

    # -- values for logs and topics ------------------------------------------------------------------------------------

    def log_row(self) -> LogRow:
        """Return the commands of all robots in the last cycle, for the control log."""
        rows = [robot.log_row() for robot in self._robots.values()]
        kinds, parts = self._kinds
        # The same list as long as no robot has switched, as the log tests for identity.
        if len(rows) != len(parts) or any(row[0] is not part for row, part in zip(rows, parts, strict=True)):
            kinds = [kind for row in rows for kind in row[0]]
            self._kinds = kinds, tuple(row[0] for row in rows)
        return kinds, [value for row in rows for value in row[1]], [value for row in rows for value in row[2]]

    def limiter_counts(self) -> LimitCounts | None:
        """Return the counts of all robots; None: one of them has no counts."""
        counts = [robot.limiter_counts() for robot in self._robots.values()]
        return LimitCounts.joined([part for part in counts if part is not None]) if all(counts) else None


def robot_nodes(root_node: Node, robot_hw_node: Node) -> dict[str, tuple[Node, Node]]:
    """Return two nodes for each combined robot, by its name: one of its namespace, and one of its private one.

    If the parameter `arms` is a mapping, its values become parameters of these namespaces, and it
    becomes a list of the names.

    Args:
        root_node: node of the namespace of all robots.
        robot_hw_node: private node of the combination.
    """
    arms = CombinedSettings.read(robot_hw_node).arms
    for name, values in arms.items() if isinstance(arms, Mapping) else ():
        for key, value in values.items():  # the namespace also has parameters of other nodes, such as a gripper
            root_node.set_param(f"{name}/{key}", value)
    robot_hw_node.set_param("arms", list(arms))
    return {name: (root_node.child(name), root_node.child(f"{name}/{PRIVATE}")) for name in arms}


def combined_input(needed: Mapping[str, PlantInput]) -> PlantInput:
    """Return what the plant of several robots needs.

    Args:
        needed: what each robot needs of it, by name of the robot.

    Raises:
        HricError: two robots have a joint or link of the same name, or parameters of the plant that
            concern all of them differ.
    """
    config: dict[str, Any] = {"rotor_inertia": {}}
    for part in needed.values():
        rotors = rotor_inertia(part.config, part.joint_names, read(part.urdf_xml))
        config["rotor_inertia"] |= dict(zip(part.joint_names, rotors, strict=True))
        config[BY_JOINT] = config.get(BY_JOINT, {}) | _mapping(part.config.get(BY_JOINT))
    rubbing = {name: part.config.get("friction", "none") for name, part in needed.items()}
    if set(rubbing.values()) == {"none", IDENTIFIED}:  # joints without friction have the same law, with zero torque
        for name, part in needed.items():
            if rubbing[name] == "none":
                config[BY_JOINT] |= {joint: dict.fromkeys(PHI, 0.0) for joint in part.joint_names}
        rubbing = dict.fromkeys(rubbing, IDENTIFIED)
    if any(kind != "none" for kind in rubbing.values()):
        config["friction"] = common("plant/friction", rubbing)
    keys = {key for part in needed.values() for key in part.config} - {
        "rotor_inertia",
        "friction",
        BY_JOINT,
        "payload",
        "seed",
    }
    for key in sorted(keys):
        config[key] = common(f"plant/{key}", {name: part.config.get(key) for name, part in needed.items()})
    config["payload"] = [load for part in needed.values() for load in _payloads(part)]
    if not config[BY_JOINT]:
        del config[BY_JOINT]
    description = combined(MODEL, {name: part.urdf_xml for name, part in needed.items()})
    return PlantInput(description, [joint for part in needed.values() for joint in part.joint_names], config)


def _payloads(part: PlantInput) -> list[object]:
    """Return the payloads of one robot, each with its link, which must be named in the plant of several robots."""
    payloads = part.config.get("payload") or []
    last = read(part.urdf_xml).joints[part.joint_names[-1]].child
    return [
        {"link": last, **load} if isinstance(load, Mapping) and load.get("mass") != 0 else load
        for load in (payloads if isinstance(payloads, list | tuple) else [payloads])
    ]


def _mapping(value: object) -> dict[str, object]:
    return dict(value) if isinstance(value, Mapping) else {}


def common(key: str, values: Mapping[str, object]) -> Any:
    """Return the value that all robots have for a parameter; raise ParameterError if they differ.

    Args:
        key: name of the parameter, relative to `robot`.
        values: value of each robot, by its name.
    """
    first, *others = values.values()
    if any(value != first for value in others):
        each = ", ".join(f"{value!r} for {name}" for name, value in values.items())
        raise ParameterError(f"{key} is {each}; valid: the same value for all robots in one plant")
    return first
