"""Class of a contact: free, the body part can recoil; clamped, another body holds it from the other side.

ISO/TS 15066:2016 calls a contact with a clamped body part quasi-static, and one with a part that can recoil transient
(as papers and guides cite it). Two interpretations of the limits follow from this; verdicts differ between them
(arXiv 2203.02706):

by_duration   the first half second of each contact has the transient limits, the time after it the quasi-static ones,
              whether the body part is clamped or not, as a force curve is evaluated after ISO/PAS 5672:2023
by_clamping   a clamped contact has the quasi-static limits from its begin; a contact whose class is not known counts as
              clamped
"""

from collections.abc import Sequence
from enum import StrEnum
from itertools import product

import numpy as np

from hric_assessment.contact.episodes import end_of
from hric_human.contact import RegionContact

BY_DURATION, BY_CLAMPING = INTERPRETATIONS = ("by_duration", "by_clamping")
OPPOSED = -0.5
"""Cosine of the angle between two forces on a body part below which they clamp it [1]: 120 degrees, chosen here."""


class ContactClass(StrEnum):
    """Class of a contact."""

    FREE = "free"
    CLAMPED = "clamped"
    UNKNOWN = "not known"


def contact_class(
    contacts: Sequence[RegionContact], touches: Sequence[RegionContact], complete: bool
) -> tuple[ContactClass, str]:
    """Return the class of a contact, and its reason.

    Args:
        contacts: contacts of an episode.
        touches: all recorded contacts of the person, rigid ones included.
        complete: True if all bodies that touch the person are recorded, as in a simulation.
    """
    unknown = ""
    for contact, touch in product(contacts, touches):
        if touch.link != contact.link or touch.other == contact.other or not _overlap(contact, touch):
            continue
        cosines = _cosines(contact, touch)
        if not cosines:
            unknown = f"the direction of the force between {contact.link} and {touch.other} is not known"
        elif min(cosines) < OPPOSED:
            return ContactClass.CLAMPED, f"{contact.link} is between {contact.other} and {touch.other}"
    if unknown or not complete:
        return ContactClass.UNKNOWN, unknown or "the recording may lack bodies that touch the person"
    return ContactClass.FREE, "no other body touches the same link from the other side"


def _overlap(first: RegionContact, second: RegionContact) -> bool:
    return first.begin <= end_of(second) and second.begin <= end_of(first)


def _cosines(first: RegionContact, second: RegionContact) -> list[float]:
    """Return the cosines between the known normals of two contacts, at begin and end of each."""
    normals = [[n for n in (contact.begin_normal, contact.normal) if n is not None] for contact in (first, second)]
    return [float(np.dot(a, b)) for a, b in product(*normals)]
