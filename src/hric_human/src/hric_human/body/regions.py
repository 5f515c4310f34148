"""The body regions of ISO/TS 15066:2016 Annex A that a link belongs to."""

from collections.abc import Sequence
from dataclasses import dataclass

from hric_human.body.segments import Segment, side_of

REGIONS = {
    "head": ("skull, forehead", "face", "neck"),
    "torso": ("back, shoulders", "chest", "abdomen"),
    "pelvis": ("pelvis",),
    "upper_arm": ("upper arm, elbow",),
    "forearm": ("lower arm, wrist",),
    "hand": ("hand, fingers",),
    "thigh": ("thigh, knee",),
    "shank": ("lower leg",),
    "foot": (),
}
"""Names of the regions by segment, as the standard's force table has them. It has none for a foot."""


@dataclass(frozen=True)
class Region:
    """A region of a link.

    Attributes:
        name: as in the standard's table.
        dominant: whether it is on the side of the dominant hand; None in the middle of the body.
    """

    name: str
    dominant: bool | None


def regions(segments: Sequence[Segment], dominant_hand: str) -> dict[str, tuple[Region, ...]]:
    """Regions by link; links between the joints of one segment have no shape and are not listed."""
    found = {}
    for segment in segments:
        side = side_of(segment.name)
        dominant = side == dominant_hand if side else None
        found[segment.link] = tuple(Region(name, dominant) for name in REGIONS[segment.kind])
    return found
