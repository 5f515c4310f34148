"""Several simulated robots in one plant, as one RobotHW: two arms on a table, with one world, one clock and one log."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain
from typing import Any

from hric_control.hardware_interface import JointStateInterface
from hric_control.limits import LimitCounts
from hric_control.plant import DEFAULT_PLANT
from hric_control.plants import PHI, rotor_inertia
from hric_control.robot_app import RobotApp
from hric_control.robot_hw import LogRow, OnCycle
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
"""Parameter of the plant that is combined by joint, as is the rotor inertia; a payload belongs to one robot."""


@dataclass(frozen=True)
class CombinedSettings(Settings):
    """Parameters of `CombinedHWSim`."""

    arms: tuple[str, ...] | Mapping[str, object] = either(
        mapping(mapping()),
        names(),
        text="`CombinedHWSim` only: names of the combined robots; the namespace of each has its `robot_description`, "
        "its controllers, and as `robot/...` the parameters of its type. A mapping also sets these namespaces",
    )


class CombinedHWSim(SimulatedRobot):
    """Several simulated robots in one plant, each with its own controller manager in its own namespace.

    Comparable to `combined_robot_hw` of ros_control. The joints of this RobotHW are those of all robots, in order; its
    own controllers can read them. One loop reads all robots, updates all controllers, writes all commands, and steps
    the plant once. The speed scale is common to all robots.

    Attributes, in addition to those of `SimulatedRobot`:
        apps: robot with its controller manager, by name of the robot.
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
        self.apps: dict[str, RobotApp] = {}
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
            self._put(self.q_start, self._reset_plant)

    def _new_robot(self, root_node: Node, private: Node) -> SimulatedRobot:
        name, robot = new_robot_hw(root_node, private)
        if not isinstance(robot, SimulatedRobot):
            raise HricError(f"{name} at {root_node.namespace} is not simulated; valid: simulated robots in one plant")
        robot.get(SpeedScaleInterface).scale = robot.speed_scale = self.speed_scale
        return robot

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

    def guarded(self, on_cycle: OnCycle) -> OnCycle:
        """Return a callback that also updates the controllers of each robot."""
        cycles = [self._robots[name].guarded(app.on_cycle) for name, app in self.apps.items()]

        def all_cycles(time: float, period: float, reset_controllers: bool) -> bool:
            on_cycle(time, period, reset_controllers)
            for cycle in cycles:
                cycle(time, period, reset_controllers)
            return True

        return all_cycles

    def run(self, on_cycle: OnCycle) -> None:
        """Run cycles: read all robots, update all controllers, write all commands, step the plant."""
        managers = [app.manager for app in self.apps.values()]
        before = [manager.loop_running for manager in managers]
        for manager in managers:
            manager.loop_running = True
        try:
            super().run(on_cycle)
        finally:
            for manager, running in zip(managers, before, strict=True):
                manager.loop_running = running

    def write(self, time: float, period: float) -> None:
        """Let each robot write its commands, and pass those of all joints to the plant."""
        for robot in self._robots.values():
            robot.write(time, period)
            if robot.error:
                self.error = "; ".join(f"{name}: {robot.error}" for name, robot in self._robots.items() if robot.error)
        self.plant.apply(self._shared.command)

    def _spans(self, values: Sequence[float]) -> Mapping[SimulatedRobot, Sequence[float]]:
        """Return the values of each robot's joints, from those of all joints."""
        result, first = {}, 0
        for robot in self._robots.values():
            result[robot] = values[first : first + len(robot.states.names)]
            first += len(robot.states.names)
        return result

    def _reset_plant(self, q: Sequence[float]) -> None:
        super()._reset_plant(q)
        self._shared.read()
        for robot, part in self._spans(q).items():
            robot._reset_plant(part)

    def _settle(self, q: Sequence[float]) -> None:
        self._shared.read()
        for robot, part in self._spans(q).items():
            robot._settle(part)
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
    """Return the nodes of combined robots by name: of its namespace, and its private one; arguments: as for `init`.

    If the parameter `arms` is a mapping, these namespaces get its values, and it becomes a list of the names.
    """
    arms = CombinedSettings.read(robot_hw_node).arms
    for name, values in arms.items() if isinstance(arms, Mapping) else ():
        root_node.set_param(name, values)
    robot_hw_node.set_param("arms", list(arms))
    return {name: (root_node.child(name), root_node.child(f"{name}/{PRIVATE}")) for name in arms}


def combined_input(needed: Mapping[str, PlantInput]) -> PlantInput:
    """Return what the plant of several robots needs.

    Args:
        needed: what each robot needs of it, by name of the robot.

    Raises:
        HricError: two robots have a joint or link of the same name, two have a payload, or parameters of the plant that
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
    carrying = [name for name, part in needed.items() if _mapping(part.config.get("payload")).get("mass")]
    if len(carrying) > 1:
        raise ParameterError(f"plant/payload is set for {' and '.join(carrying)}; valid: for one of the robots")
    for name in carrying:
        part = needed[name]
        last = read(part.urdf_xml).joints[part.joint_names[-1]].child
        config["payload"] = {"link": last, **_mapping(part.config["payload"])}
    if not config[BY_JOINT]:
        del config[BY_JOINT]
    description = combined(MODEL, {name: part.urdf_xml for name, part in needed.items()})
    return PlantInput(description, [joint for part in needed.values() for joint in part.joint_names], config)


def _mapping(value: object) -> dict[str, object]:
    return dict(value) if isinstance(value, Mapping) else {}


def common(key: str, values: Mapping[str, object]) -> Any:
    """Return the value of a parameter that is the same for all robots, by name; raise ParameterError if it differs."""
    first, *others = values.values()
    if any(value != first for value in others):
        each = ", ".join(f"{value!r} for {name}" for name, value in values.items())
        raise ParameterError(f"{key} is {each}; valid: the same value for all robots in one plant")
    return first
