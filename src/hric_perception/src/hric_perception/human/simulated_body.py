"""Simulated human as measured by cameras: hand, bones and markers of the body. No ROS."""

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
"""Kind of a simulated human's event -> phase of their motion that begins with it."""
SKELETON = "body"
"""Name of the streamed skeleton; different from `human`, the prefix of the simulated human's own frames."""


class SimulatedBody(Program):
    """Program that moves the hand as the simulated human does; its times are those of the mocap stream [s].

    Args:
        person: section `human` of the experiment.
        T_base_world: pose of the world in the robot's base.

    Attributes:
        states: joint states of the human over robot time.
        robot_time: function from stream time to robot time [s]; it returns None while that is not known.
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
        """Return the pose of the hand in the robot's base at a time of the stream [s]."""
        return compose(self._T_base_root, self._hand.pose(self._q(time)))

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the program [s]: 0 and infinity, because the end is not known before; see `phase`."""
        return 0.0, float("inf")

    def phase(self, time: float) -> str:
        """Return the phase of the motion at a time of the stream [s], from the human's events: rest, moving or done."""
        robot_time, changes = self.robot_time(time), self._changes
        if robot_time is None:
            return REST
        done = bisect_right(changes, robot_time, key=lambda change: change[0])
        return changes[done - 1][1] if done else REST

    def happened(self, time: float, kind: str) -> None:
        """Store an event of the human; time: robot time [s]; kind: kind of the event, e.g. "started"."""
        if kind in PHASES:
            self._changes = [*(change for change in self._changes if change[0] <= time), (time, PHASES[kind])]

    def skeleton(self, number: int, T_mocap_base: Pose) -> ServedSkeleton:
        """Return the skeleton as the cameras see it: a bone for each segment, with the axes of its link.

        Args:
            number: streaming id of the skeleton.
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
        """Return the joint positions [rad] at a time of the stream [s]; all 0 while they are not known."""
        robot_time = self.robot_time(time)
        positions = None if robot_time is None else self.states.at(robot_time)
        return self._rest if positions is None else positions


def _same(time: float) -> float:
    return time
