"""Description of an articulated human, generated from a subject.

    body = describe(load(Path("subject.yaml")))
    body.urdf, body.joints["right_el_flex"].range, body.regions["r_wrist"]

The table of masses and lengths is in `anthropometry`, the table of joints in `joints`, ISB's angles in `isb`.
"""

from hric_human.body.description import Body, describe
from hric_human.body.isb import from_isb, to_isb
from hric_human.body.joints import BodyJoint
from hric_human.body.markers import AttachedMarker
from hric_human.body.regions import Region, surfaces
from hric_human.body.segments import BodySegment
from hric_human.body.subject import Subject, load

__all__ = [
    "AttachedMarker",
    "Body",
    "BodyJoint",
    "BodySegment",
    "Region",
    "Subject",
    "describe",
    "from_isb",
    "load",
    "surfaces",
    "to_isb",
]
