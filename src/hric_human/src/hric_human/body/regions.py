"""Body regions of ISO/TS 15066:2016 Annex A by link, and the spring and mass that it assumes for each region."""

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
"""Regions of each body segment, named as in the force table of ISO/TS 15066, which has none for a foot."""


class RegionModel(NamedTuple):
    """Model of one body region in ISO/TS 15066: a mass behind a spring.

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
"""Body model of ISO/TS 15066:2016, Annex A, by region.

The standard's text was not opened; the values are equal in two or more public sources (papers and code). The standard
gives the stiffness in N/mm, and no damping.
"""


class TissueLaw(NamedTuple):
    """Contact law of skin and tissue, beside the stiffness of the region.

    Attributes:
        dissipation: dissipation of Hunt and Crossley [s/m].
        relaxing_ratio: stiffness that relaxes, relative to the stiffness of the region [1].
        relaxation_time: relaxation time [s]; None: the tissue does not relax.
    """

    dissipation: float = 0.0
    relaxing_ratio: float = 0.0
    relaxation_time: float | None = None


TISSUE_LAWS = {
    "spring": TissueLaw(),
    "hunt_crossley": TissueLaw(dissipation=2.0),
    "viscoelastic": TissueLaw(relaxing_ratio=1.0, relaxation_time=4e-3),
}
"""Contact laws of the person's surface, which `human.contact_law` selects.

spring: the law of ISO/TS 15066, without loss of energy.
hunt_crossley: 2 s/m is the dissipation of the sole of the foot in OpenSim's model 2D_gait (confirmed twice, in public
copies of the model; unconfirmed for other regions). The exponent 1 is chosen here: without dissipation the law is then
that of the standard.
viscoelastic: 4 ms is the shortest of the three relaxation times of the human fingerpad (4 ms, 70 ms, 1.4 s), Pawluk and
Howe, J Biomech Eng 121(2), 1999, abstract (confirmed once; unconfirmed for other regions). The abstract has no
amplitudes: the ratio 1 is chosen here. The relaxed tissue has the stiffness of the standard, so that a fast impact has
a higher peak than with the standard's spring.
"""
SPRING_OF = {"head": "skull, forehead", "torso": "chest"}
"""Region whose spring is used for a segment of several regions, since a link has one contact stiffness.

For the head it is the stiffest, which gives the largest force; for the torso the chest, which a robot in front of a
person touches (project defaults, unconfirmed). The back is 1.4 times as stiff as the chest, the abdomen 0.4 times.
"""


@dataclass(frozen=True)
class Region:
    """Body region of ISO/TS 15066 that a link belongs to.

    Attributes:
        name: name in the standard's force table.
        dominant: True on the side of the dominant hand, False on the other; None in the middle of the body.
    """

    name: str
    dominant: bool | None


def regions(segments: Sequence[BodySegment], dominant_hand: str) -> dict[str, tuple[Region, ...]]:
    """Return the regions of ISO/TS 15066 by link; auxiliary links between joints have no shape and are left out."""
    by_link = {}
    for segment in segments:
        side = side_of(segment.name)
        dominant = side == dominant_hand if side else None
        by_link[segment.link] = tuple(Region(name, dominant) for name in REGIONS[segment.kind])
    return by_link


def surfaces(body: Body, law: str = "spring") -> dict[str, Surface]:
    """Return the contact surface of each link for `Plant.spawn`, with the stiffness of the ISO/TS 15066 body model.

    A link without a region, such as a foot, is left out and stays rigid. `law`: a key of TISSUE_LAWS.
    """
    tissue, by_link = TISSUE_LAWS[law], {}
    for segment in body.segments.values():
        names = REGIONS[segment.kind]
        if names:
            stiffness = REGION_MODELS[SPRING_OF.get(segment.kind, names[0])].stiffness
            by_link[segment.link] = Surface(
                stiffness,
                dissipation=tissue.dissipation,
                relaxing=tissue.relaxing_ratio * stiffness,
                relaxation_time=tissue.relaxation_time,
            )
    return by_link
