"""Markers of a body: names and positions of the Plug-in Gait full-body set, scaled with the segments.

The positions follow the description of Vicon's 39 markers (J. Sports Sci. Med. 15:92, table 2); the values that place
them on a capsule are a project default, unconfirmed. The thigh, shank, upper arm and forearm markers are at different
heights on the left and on the right, so that sides can be distinguished.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.body.segments import SIDES, BodySegment, side_of


@dataclass(frozen=True)
class AttachedMarker:
    """Motion capture marker on a body.

    Attributes:
        name: name in Plug-in Gait.
        link: link that the marker is fixed to.
        p_link_marker: position in axes of the link, shape (3,) [m].
    """

    name: str
    link: str
    p_link_marker: FloatArray


@dataclass(frozen=True)
class MarkerRow:
    """Row of the table of markers: the place of one Plug-in Gait marker on its segment.

    Attributes:
        name: name in Plug-in Gait, without L or R for a marker of both sides.
        segment: segment that the marker is on; "shoulder": at the shoulder joint centre, fixed to the upper arm's
            parent link.
        share: position along the segment's axis from its start, on the left and on the right [1].
        offset: offset forward, outward (on middle segments: to the left) and up, in capsule radii of the segment [1].
    """

    name: str
    segment: str
    share: tuple[float, float]
    offset: tuple[float, float, float]


def _at(share: float) -> tuple[float, float]:
    return share, share


BOTH_SIDES = (
    MarkerRow("SHO", "shoulder", _at(0.0), (0.0, 0.0, 1.2)),
    MarkerRow("UPA", "upper_arm", (0.33, 0.67), (0.0, 1.0, 0.0)),
    MarkerRow("ELB", "upper_arm", _at(1.0), (0.0, 1.0, 0.0)),
    MarkerRow("FRM", "forearm", (0.67, 0.33), (0.0, 1.0, 0.0)),
    MarkerRow("WRA", "forearm", _at(1.0), (1.0, 0.0, 0.0)),
    MarkerRow("WRB", "forearm", _at(1.0), (-1.0, 0.0, 0.0)),
    MarkerRow("FIN", "hand", _at(0.42), (0.0, 1.0, 0.0)),
    MarkerRow("THI", "thigh", (0.67, 0.5), (0.0, 1.0, 0.0)),
    MarkerRow("KNE", "thigh", _at(1.0), (0.0, 1.0, 0.0)),
    MarkerRow("TIB", "shank", (0.67, 0.5), (0.0, 1.0, 0.0)),
    MarkerRow("ANK", "shank", _at(1.0), (0.0, 1.0, 0.0)),
    MarkerRow("HEE", "foot", _at(0.0), (0.0, 0.0, 0.0)),
    MarkerRow("TOE", "foot", _at(0.7), (0.0, 0.0, 1.0)),
)
MIDDLE = (
    MarkerRow("LFHD", "head", _at(0.7), (0.7, 0.7, 0.0)),
    MarkerRow("RFHD", "head", _at(0.7), (0.7, -0.7, 0.0)),
    MarkerRow("LBHD", "head", _at(0.7), (-0.7, 0.7, 0.0)),
    MarkerRow("RBHD", "head", _at(0.7), (-0.7, -0.7, 0.0)),
    MarkerRow("C7", "torso", _at(1.0), (-0.5, 0.0, 0.0)),
    MarkerRow("T10", "torso", _at(0.45), (-1.0, 0.0, 0.0)),
    MarkerRow("CLAV", "torso", _at(0.84), (0.85, 0.0, 0.0)),
    MarkerRow("STRN", "torso", _at(0.48), (1.0, 0.0, 0.0)),
    MarkerRow("RBAK", "torso", _at(0.65), (-0.9, -0.45, 0.0)),
    MarkerRow("LASI", "pelvis", _at(0.5), (0.85, 1.35, 0.4)),
    MarkerRow("RASI", "pelvis", _at(0.5), (0.85, -1.35, 0.4)),
    MarkerRow("LPSI", "pelvis", _at(0.5), (-0.9, 0.5, 0.4)),
    MarkerRow("RPSI", "pelvis", _at(0.5), (-0.9, -0.5, 0.4)),
)


def markers(segments: Sequence[BodySegment]) -> list[AttachedMarker]:
    """Return the markers on the segments of a body."""
    made = []
    for segment in segments:
        side = side_of(segment.name)
        for row in BOTH_SIDES if side else MIDDLE:
            if row.segment == segment.kind:
                made.append(_marker(row, segment, side))
            elif (row.segment, segment.kind) == ("shoulder", "upper_arm"):
                offset = segment.radius * np.array(row.offset)
                made.append(AttachedMarker(side[0].upper() + row.name, segment.parent, segment.p_parent_link + offset))
    return made


def _marker(row: MarkerRow, segment: BodySegment, side: str) -> AttachedMarker:
    share = row.share[side == "right"]
    offset = segment.radius * np.array(row.offset) * [1.0, SIDES.get(side, 1.0), 1.0]
    name = side[:1].upper() + row.name
    return AttachedMarker(name, segment.link, segment.start + share * (segment.end - segment.start) + offset)


def marker_labels(file: str, labels: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Return the recording's label of each marker: the marker's name, or with a prefix, as subject:RSHO or body_RSHO.

    Args:
        file: name of the file, for messages.
        labels: labels of the recording.
        names: names of the body's markers.

    Raises:
        HricError: the recording has no marker of the body, or markers of several bodies.
    """
    by_prefix: dict[str, dict[str, str]] = {}
    for label in labels:
        name = re.split("[:_]", label)[-1]
        if name in names:
            by_prefix.setdefault(label.removesuffix(name), {})[name] = label
    if len(by_prefix) != 1:
        several = f"markers of {len(by_prefix)} bodies: {', '.join(map(repr, by_prefix))}"
        what = several if by_prefix else "no marker of the body"
        raise HricError(
            f"{file} has {what}; valid: markers of one body, some of {', '.join(names)}; it has {', '.join(labels)}"
        )
    return by_prefix.popitem()[1]
