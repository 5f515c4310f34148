"""Body regions of ISO/TS 15066:2016 Annex A by link, and the standard's model of a body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from hric_control.plant import Surface
from hric_human.body.segments import BodySegment, side_of

if TYPE_CHECKING:
    from hric_human.body.description import Body

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
"""Names of the regions by segment, as in the standard's force table; it has none for a foot."""


class RegionModel(NamedTuple):
    """Region as the standard models it: a mass behind a spring.

    Attributes:
        stiffness: stiffness of the spring [N/m].
        mass: effective mass [kg], for comparison; the effective mass of a simulated body depends on its pose.
    """

    stiffness: float
    mass: float


REGION_MODELS = {
    "skull, forehead": RegionModel(150e3, 4.4),
    "face": RegionModel(75e3, 4.4),
    "neck": RegionModel(50e3, 1.2),
    "back, shoulders": RegionModel(35e3, 40.0),
    "chest": RegionModel(25e3, 40.0),
    "abdomen": RegionModel(10e3, 40.0),
    "pelvis": RegionModel(25e3, 40.0),
    "upper arm, elbow": RegionModel(30e3, 3.0),
    "lower arm, wrist": RegionModel(40e3, 2.0),
    "hand, fingers": RegionModel(75e3, 0.6),
    "thigh, knee": RegionModel(50e3, 75.0),
    "lower leg": RegionModel(60e3, 75.0),
}
"""Body model of ISO/TS 15066:2016, Annex A.

The standard's text was not opened; the values are equal in two or more public sources (papers and code). The standard
prints N/mm. It has no damping.
"""
SPRING_OF = {"head": "skull, forehead", "torso": "chest"}
"""Region whose spring is used for a segment of several regions: a link has one surface.

For a head it is the stiffest, which gives the largest force; for a torso the chest, which a robot in front of a person
touches (project defaults, unconfirmed). A back is 1.4 times as stiff as that, an abdomen 0.4 times.
"""


@dataclass(frozen=True)
class Region:
    """Region of a link.

    Attributes:
        name: name in the standard's table.
        dominant: True on the side of the dominant hand; None in the middle of the body.
    """

    name: str
    dominant: bool | None


def regions(segments: Sequence[BodySegment], dominant_hand: str) -> dict[str, tuple[Region, ...]]:
    """Return the regions by link; links between the joints of one segment have no shape and are not listed."""
    by_link = {}
    for segment in segments:
        side = side_of(segment.name)
        dominant = side == dominant_hand if side else None
        by_link[segment.link] = tuple(Region(name, dominant) for name in REGIONS[segment.kind])
    return by_link


def surfaces(body: Body) -> dict[str, Surface]:
    """Return the surface by link: the spring of the standard's body model, for `spawn` of a plant.

    A link without a region, such as a foot, is left out, and stays rigid.
    """
    by_link = {}
    for segment in body.segments.values():
        names = REGIONS[segment.kind]
        if names:
            by_link[segment.link] = Surface(REGION_MODELS[SPRING_OF.get(segment.kind, names[0])].stiffness)
    return by_link
