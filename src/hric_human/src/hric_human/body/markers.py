"""Markers of a body: names and positions of the Plug-in Gait full-body set, scaled with the segments.

The positions follow the description of Vicon's 39 markers (J. Sports Sci. Med. 15:92, table 2). Two groups of values
have a source; the others, which place markers on a capsule, are project defaults, unconfirmed. The pelvis markers are
where the regression of Harrington et al. (J. Biomech. 40:595, 2007) has the hip joint centres, for a pelvis that is
0.24 m wide and 0.16 m deep; the knee marker is half a femur's width of 95.2 mm (Ross and Wilson's phantom, Br. J.
Sports Med. 8:123, 1974) from the knee; both with 7 mm for the marker. The thigh, shank, upper arm and forearm markers
are at different heights on the left and on the right, so that sides can be distinguished.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_human.body.segments import SIDES, BodySegment, side_of

SEPARATORS = "[:_/]"
"""Characters, as a regular expression, between the prefix of a label and the name of the marker."""
FEW = 4
"""Smallest number of markers of a prefix that counts as a body if there are several (project default, unconfirmed)."""
LYING = 2.0
"""Ratio of distances along y and z, from feet to head, above which z cannot be up (project default, unconfirmed)."""

HEAD_ENDS = ("FHD", "BHD", "HEADL", "HEADR", "HEADTOP", "HEADFRONT", "TOPHEAD", "HEAD")
PELVIS_ENDS = ("ASI", "PSI", "SACR", "HIP", "PELVIS")
FEET_ENDS = ("ANK", "HEE", "TOE")
"""Endings of the names of markers, in capitals, by which the upright direction is checked."""


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
            parent link; "hips": at the midpoint of the hip joint centres, on the pelvis.
        share: position along the segment's axis from its start, on the left and on the right [1].
        offset: offset forward, outward (on middle segments: to the left) and up, in capsule radii of the segment [1].
    """

    name: str
    segment: str
    share: tuple[float, float]
    offset: tuple[float, float, float]


@dataclass(frozen=True)
class ExtraMarker:
    """Marker of a marker set that is not in the table below.

    Attributes:
        name: complete name of the marker.
        row: place on its segment.
        side: "right", "left" or "" (middle); "outward" of a marker on a middle segment is to this side.
        loose: True if the marker is on soft tissue or on a wand.
    """

    name: str
    row: MarkerRow
    side: str = ""
    loose: bool = False


def _at(share: float) -> tuple[float, float]:
    return share, share


BOTH_SIDES = (
    MarkerRow("SHO", "shoulder", _at(0.0), (0.0, -0.4, 1.2)),
    MarkerRow("UPA", "upper_arm", (0.33, 0.67), (0.0, 1.0, 0.0)),
    MarkerRow("ELB", "upper_arm", _at(1.0), (0.0, 1.0, 0.0)),
    MarkerRow("FRM", "forearm", (0.67, 0.33), (0.0, 1.0, 0.0)),
    MarkerRow("WRA", "forearm", _at(1.0), (1.0, 0.0, 0.0)),
    MarkerRow("WRB", "forearm", _at(1.0), (-1.0, 0.0, 0.0)),
    MarkerRow("FIN", "hand", _at(0.42), (0.0, 1.0, 0.0)),
    MarkerRow("THI", "thigh", (0.67, 0.5), (0.0, 1.0, 0.0)),
    MarkerRow("KNE", "thigh", _at(1.0), (0.0, 0.7, 0.0)),
    MarkerRow("TIB", "shank", (0.67, 0.5), (0.0, 1.0, 0.0)),
    MarkerRow("ANK", "shank", _at(1.0), (0.0, 1.0, 0.0)),
    MarkerRow("HEE", "foot", _at(0.0), (-0.2, 0.0, 0.25)),
    MarkerRow("TOE", "foot", _at(0.7), (0.0, 0.0, 0.25)),
)
MIDDLE = (
    MarkerRow("LFHD", "head", _at(0.7), (0.88, 0.84, 0.0)),
    MarkerRow("RFHD", "head", _at(0.7), (0.88, -0.84, 0.0)),
    MarkerRow("LBHD", "head", _at(0.7), (-1.02, 0.74, 0.0)),
    MarkerRow("RBHD", "head", _at(0.7), (-1.02, -0.74, 0.0)),
    MarkerRow("C7", "torso", _at(1.0), (-0.45, 0.0, 0.0)),
    MarkerRow("T10", "torso", _at(0.45), (-0.67, 0.0, 0.0)),
    MarkerRow("CLAV", "torso", _at(0.84), (0.45, 0.0, 0.0)),
    MarkerRow("STRN", "torso", _at(0.48), (0.67, 0.0, 0.0)),
    MarkerRow("RBAK", "torso", _at(0.65), (-0.65, -0.45, 0.0)),
    MarkerRow("LASI", "hips", _at(0.0), (0.58, 1.29, 0.89)),
    MarkerRow("RASI", "hips", _at(0.0), (0.58, -1.29, 0.89)),
    MarkerRow("LPSI", "hips", _at(0.0), (-1.26, 0.5, 0.89)),
    MarkerRow("RPSI", "hips", _at(0.0), (-1.26, -0.5, 0.89)),
)


def markers(segments: Sequence[BodySegment], extra: Sequence[ExtraMarker] = ()) -> list[AttachedMarker]:
    """Return the markers on the segments of a body: those of the table, and the extra ones whose segment exists."""
    made = []
    for segment in segments:
        side = side_of(segment.name)
        rows = [(side[:1].upper() + row.name, row, side) for row in (BOTH_SIDES if side else MIDDLE)]
        rows += [(marker.name, marker.row, marker.side) for marker in extra if side in ("", marker.side)]
        made += [_marker(name, row, segment, of) for name, row, of in rows if _kind(row) == segment.kind]
    return made


def _kind(row: MarkerRow) -> str:
    """Return the kind of the segment that determines the place of a marker."""
    return {"shoulder": "upper_arm", "hips": "pelvis"}.get(row.segment, row.segment)


def _marker(name: str, row: MarkerRow, segment: BodySegment, side: str) -> AttachedMarker:
    offset = segment.radius * np.array(row.offset) * [1.0, SIDES.get(side, 1.0), 1.0]
    if row.segment == "shoulder":
        return AttachedMarker(name, segment.parent, segment.p_parent_link + offset)
    if row.segment == "hips":
        return AttachedMarker(name, segment.link, offset)
    share = row.share[side == "right"]
    return AttachedMarker(name, segment.link, segment.start + share * (segment.end - segment.start) + offset)


def marker_labels(file: str, labels: Sequence[str], names: Sequence[str], prefix: str = "") -> dict[str, str]:
    """Return the recording's label of each marker: the marker's name in upper or lower case, also with a prefix.

    Examples are RSHO, rsho, subject:RSHO and body_RSHO. A prefix with fewer than FEW markers of the body, such as that
    of virtual markers, is ignored next to one with more.

    Args:
        file: name of the file, for messages.
        labels: labels of the recording.
        names: names of the body's markers.
        prefix: prefix of the person's labels, with or without the separator at its end; "": there is one person.

    Raises:
        ParameterError: the recording has no marker of the body, or markers of several bodies.
    """
    by_prefix: dict[str, dict[str, str]] = {}
    upper = {name.upper(): name for name in names}
    for label in labels:
        last = re.split(SEPARATORS, label)[-1]
        if last.upper() in upper:
            by_prefix.setdefault(label.removesuffix(last), {}).setdefault(upper[last.upper()], label)
    if prefix:
        bodies = {key: found for key, found in by_prefix.items() if key.strip(":_/") == prefix.strip(":_/")}
    else:
        bodies = {key: found for key, found in by_prefix.items() if len(found) >= FEW} or by_prefix
    if len(bodies) == 1:
        return bodies.popitem()[1]
    if by_prefix:
        several = ", ".join(f"{key!r} ({len(found)} markers)" for key, found in by_prefix.items())
        what = f"no markers with the prefix {prefix!r}" if prefix else f"markers of {len(bodies)} bodies"
        raise ParameterError(f"{file} has {what}; give the prefix of one person; valid: {several}")
    raise ParameterError(
        f"{file} has no marker of the body; valid: markers of one body, some of {', '.join(names)}; it has "
        f"{', '.join(labels)}"
    )


def check_upright(file: str, positions: Mapping[str, FloatArray], up: str = "z") -> None:
    """Check that the axis that was assumed to point up in a recording does so by the markers of the person.

    Args:
        file: name of the file, for messages.
        positions: marker positions by marker name, rotated to z up, shape (frames, 3) each [m]; NaN: not seen.
        up: axis of the file that was assumed to point up, y or z.

    Raises:
        ParameterError: from feet (or pelvis) to head it is much farther along the other axis.
    """
    head, pelvis, feet = (
        [positions[name] for name in positions if name.upper().endswith(ends)]
        for ends in (HEAD_ENDS, PELVIS_ENDS, FEET_ENDS)
    )
    lower = feet or pelvis
    if not head or not lower:
        return
    rises = _middle(head) - _middle(lower)
    rises = rises[np.isfinite(rises).all(axis=1)]
    _, y, z = np.median(rises, axis=0) if len(rises) else np.zeros(3)
    other, beside = ("y", y) if up == "z" else ("z", -y)
    if beside > LYING * abs(z):
        raise ParameterError(
            f"{file} does not state which axis points up; with {up} up, the head is {z:.2f} m above the "
            f"{'feet' if feet else 'pelvis'} and {beside:.2f} m beside them along {other}; state up: {other}, or "
            f"up: {up} if the person lies"
        )


def _middle(positions: Sequence[FloatArray]) -> FloatArray:
    """Return the mean of the visible markers in each frame, shape (frames, 3) [m]; NaN: none is visible."""
    seen = np.isfinite(positions).sum(axis=0)
    return np.asarray(np.nansum(positions, axis=0) / np.where(seen, seen, np.nan))
