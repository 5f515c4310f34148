"""Parameters of the joint trajectory controllers, with the names of ros_controllers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hric_control.pid import Pid, PidGains
from hric_controllers.parameters import STRICT_GAINS, LawSettings, state_rate
from hric_controllers.trajectory.follower import GoalTolerances, Tolerance
from hric_core.node import Node
from hric_core.parameters import Settings, below, flag, mapping, names, number, per_joint, section, unknown
from hric_core.urdf import read


@dataclass(frozen=True)
class Constraints(Settings):
    """Tolerances common to all joints, parameters in the namespace `constraints`."""

    goal_time: float = number(0.0, minimum=0.0, unit="s", text="how long after its end a goal may still be reached")
    stopped_velocity_tolerance: float = number(
        0.01, minimum=0.0, unit="rad/s", text="largest velocity error at the goal; 0: no limit"
    )


@dataclass(frozen=True)
class JointConstraints(Settings):
    """Tolerances of one joint, parameters in the namespace `constraints/<joint>`."""

    trajectory: float = number(0.0, minimum=0.0, unit="rad", text="largest position error on the way; 0: no limit")
    goal: float = number(0.0, minimum=0.0, unit="rad", text="largest position error at the goal; 0: no limit")


@dataclass(frozen=True)
class TrajectorySettings(Settings):
    """Parameters common to the effort and the position trajectory controller."""

    joints: tuple[str, ...] = names(text="trajectory controllers from here on")
    constraints: Mapping[str, object] = mapping(default={}, text="see the following")
    stop_trajectory_duration: float = number(
        0.5,
        minimum=0.0,
        unit="s",
        text="time in which a stop brings the joints to rest, at constant deceleration; 0: at once",
    )
    allow_partial_joints_goal: bool = flag(False, text="goals may leave joints out; those go on with what they do")
    allow_integration_in_goal_trajectories: bool = flag(
        False, text="accepted for the sake of existing YAML, without effect: every point needs positions"
    )
    state_publish_rate: float = state_rate(50.0)
    action_monitor_rate: float = number(
        20.0, minimum=0.0, unit="Hz", text="of the action's feedback; the result comes at once"
    )

    def tolerances(self, where: str) -> GoalTolerances:
        """Return the tolerances that the parameter `constraints` gives; `where`: full name of this parameter.

        Raises:
            ParameterError: an unknown name below `constraints`, or a value out of range.
        """
        general = ("goal_time", "stopped_velocity_tolerance")
        shared = {name: value for name, value in self.constraints.items() if name not in self.joints}
        for name in shared:
            if name not in general:
                raise unknown("constraint", name, (*general, *self.joints), where)
        constraints = Constraints.of(shared, where)
        by_joint = [JointConstraints.of(self.constraints.get(name), f"{below(where)}{name}") for name in self.joints]
        path = tuple(Tolerance(joint.trajectory) for joint in by_joint)
        goal = tuple(Tolerance(joint.goal, constraints.stopped_velocity_tolerance) for joint in by_joint)
        return GoalTolerances(path, goal, constraints.goal_time)


@dataclass(frozen=True)
class JointGains(PidGains):
    """PID gains of one joint, from position errors [rad or m] to efforts [N m or N].

    None is negative: a negative gain would move the joint away from its desired position.
    """

    p: float = number(minimum=0.0, unit="N m/rad", text="effort version only")
    i: float = number(0.0, minimum=0.0, unit="N m/(rad s)")
    d: float = number(0.0, minimum=0.0, unit="N m s/rad")


@dataclass(frozen=True)
class EffortTrajectorySettings(LawSettings):
    """Additional parameters of the effort trajectory controller."""

    gains: tuple[JointGains, ...] = per_joint(section(JointGains))
    velocity_ff: tuple[float, ...] = per_joint(number(unit="N m s/rad"), 0.0, text="times the desired velocity")
    strict_gains: bool = STRICT_GAINS

    def pids(self) -> list[Pid]:
        """Return a new PID for each joint."""
        return [Pid(gains) for gains in self.gains]

    def idle_integrals(self, joints: Sequence[str]) -> list[str]:
        """Return the names of the joints whose integral gain has no effect since both integral bounds are zero."""
        return [joint for joint, gains in zip(joints, self.gains, strict=True) if gains.i and not any(gains.i_bounds)]


def continuous_joints(root_node: Node, joints: Sequence[str]) -> list[bool]:
    """Return True for each joint whose type in robot_description is continuous; all False if there is none."""
    urdf_xml = root_node.search_param("robot_description", "")
    described = read(urdf_xml).joints if urdf_xml else {}
    return [joint in described and described[joint].type == "continuous" for joint in joints]
