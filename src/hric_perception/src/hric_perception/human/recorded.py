"""The emulated human as a recorded trial: markers of a c3d file, beside the robot. No ROS."""

from __future__ import annotations

from collections.abc import Callable

from hric_control.errors import HricError, ParameterError
from hric_perception.human.hand import Hand
from hric_perception.replayed import read_file
from hric_perception.section import Section, Vector
from mocap_natnet.poses import Pose, compose
from mocap_natnet.server.c3d_source import RecordedBody, labels_of
from mocap_natnet.server.scene import Body
from mocap_natnet.trial import PROGRAM

KEYS = ("path", "up", "labels", "bodies")
"""Of `human` with the program c3d, beside those of each program."""


class Recorded:
    """A program whose hand goes the way of a recorded one; it is as smooth as that was measured.

    Args:
        bodies: name -> body; the first is the hand.
        T_base_mocap: where the laboratory's frame, z up, stands in the robot's base.
    """

    def __init__(self, bodies: dict[str, RecordedBody], T_base_mocap: Pose) -> None:
        self._hand, self.bodies, self._T = next(iter(bodies.values())), bodies, T_base_mocap

    def pose(self, time: float) -> Pose:
        """See Program; where the hand was not seen, on the straight way between where it was."""
        return compose(self._T, self._hand.pose(time))

    def phase(self, time: float) -> str:
        """See Program."""
        return "rest" if time < 0 else "moving" if time < self._hand.duration else "done"

    def see(self, time: float, position: Vector) -> None:
        """Heeds nothing."""

    def seen(self, hand: Hand) -> list[Body]:
        """All bodies as the cameras see them, in the time of the hand."""
        return [_body(name, number, body, hand.since) for number, (name, body) in enumerate(self.bodies.items(), 1)]


def _body(name: str, number: int, body: RecordedBody, since: Callable[[float], float]) -> Body:
    return Body(name, lambda time: body(since(time)), number, body.markers, lambda time: body.seen(since(time)))


def is_recorded(section: Section) -> bool:
    """Whether a section `human` replays a trial."""
    return section.content.get("program") == PROGRAM


def read_recorded(section: Section, T_base_mocap: Pose) -> Recorded:
    """The program of a mapping: `path`, `up`, `labels` of the hand's markers, `bodies`: further ones, name -> labels.

    Raises:
        HricError: a value that cannot be; names the key.
    """
    section.only("program", "begin", "name", "still", *KEYS)
    trial, name = read_file(section), section.text("name", "hand")
    wanted = {name: section.texts("labels") if "labels" in section.content else None}
    others = section.section("bodies")
    wanted |= {other: others.texts(other) for other in others.content if _new(other, name, others)}
    try:
        return Recorded({body: RecordedBody(trial, labels or labels_of(trial, body)) for body, labels in wanted.items()}, T_base_mocap)
    except HricError as error:
        raise ParameterError(f"{section.where}: {error}") from error


def _new(other: str, name: str, section: Section) -> bool:
    if other == name:
        raise ParameterError(f"{section.where} has {name!r}, which is the hand; valid: other names")
    return True
