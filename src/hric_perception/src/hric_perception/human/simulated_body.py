"""Human in the robot's plant as measured by cameras: hand, bones and markers of the body. No ROS."""

from bisect import bisect_right
from collections.abc import Callable, Sequence

from hric_core.geometry import Pose, Vector, compose
from hric_human.body.segments import ROOT
from hric_human.control.human_control import ControlSettings, hand_side
from hric_human.control.kinematics import HandChain
from hric_human.control.whole_body import WholeBody
from hric_human.hand import Program
from hric_human.hand.program import DONE, MOVING, REST
from hric_human.participant.settings import HumanSettings
from hric_perception.simulated import JointTrack
from mocap_natnet.server import Bone, ServedSkeleton

PHASES = {"started": MOVING, "ended": DONE}
"""Phase that begins with an event of that kind."""
SKELETON = "body"
"""Name in the description, and of its published data; different from the frames of the human, `human/...`."""


class SimulatedBody(Program):
    """Motion of the human in the plant, by the time of a stream.

    Args:
        person: section `human` of the experiment.
        T_base_world: pose of the world in the robot's base.

    Attributes:
        states: track of the joint states.
        robot_time: time of the stream -> robot time [s]; None while that is not known.
    """

    def __init__(self, person: HumanSettings, T_base_world: Pose) -> None:
        self._body = body = person.body()
        side = hand_side(body, ControlSettings.of(person.control, f"{person.prefix}control").side, person.prefix)
        self._dynamics, self._hand = WholeBody(body), HandChain(body, side)
        self._T_base_root = compose(T_base_world, person.root(body))
        self.states = JointTrack(list(body.joints))
        self.robot_time: Callable[[float], float | None] = _same
        self._rest = [0.0] * len(body.joints)
        self._changes: list[tuple[float, str]] = []

    def pose(self, time: float) -> Pose:
        """Return the pose of the hand in the base."""
        return compose(self._T_base_root, self._hand.pose(self._q(time)))

    @property
    def span(self) -> tuple[float, float]:
        """Start 0 and an infinite end; `phase` is more precise."""
        return 0.0, float("inf")

    def phase(self, time: float) -> str:
        """Return the phase from the events of the human."""
        robot_time, changes = self.robot_time(time), self._changes
        if robot_time is None:
            return REST
        done = bisect_right(changes, robot_time, key=lambda change: change[0])
        return changes[done - 1][1] if done else REST

    def happened(self, time: float, kind: str) -> None:
        """Store an event of the human at a robot time [s]."""
        if kind in PHASES:
            self._changes = [*(change for change in self._changes if change[0] <= time), (time, PHASES[kind])]

    def skeleton(self, number: int, T_mocap_base: Pose) -> ServedSkeleton:
        """Return the skeleton as the cameras see it: a bone for each segment, with the axes of its link.

        Args:
            number: its streaming id.
            T_mocap_base: pose of the robot's base in the mocap frame, z up.
        """
        segments, T_mocap_root = list(self._body.segments.values()), compose(T_mocap_base, self._T_base_root)
        names = {ROOT: "", **{segment.link: segment.name for segment in segments}}
        bones = []
        for segment in segments:
            x, y, z = segment.p_parent_link.tolist()
            bones.append(Bone(segment.name, names[segment.parent], (x, y, z)))

        def source(time: float) -> tuple[Sequence[Pose], Sequence[Vector]]:
            poses = self._dynamics.poses(self._q(time), T_mocap_root)
            return [poses[segment.link] for segment in segments], list(self._dynamics.markers(poses).values())

        return ServedSkeleton(SKELETON, number, tuple(bones), tuple(self._body.markers), source)

    def _q(self, time: float) -> Sequence[float]:
        """Return the joint positions at a time of the stream [rad]."""
        robot_time = self.robot_time(time)
        positions = None if robot_time is None else self.states.at(robot_time)
        return self._rest if positions is None else positions


def _same(time: float) -> float:
    return time
