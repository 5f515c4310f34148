"""What `ContactState.info` of `sim/contacts` says of a pair of bodies: whether its force is one that a sensor would
read, and its peak. No ROS."""

import re
from dataclasses import dataclass

KINDS = ("rigid", "penalty")
UNKNOWN = "unknown"
"""Kind of a contact without an `info`, as in older bags."""
_FORM = re.compile(r"(?P<kind>rigid|penalty) contact of \S+ on [^\s;]+(; peak (?P<peak>[-+.\deE]+) N)?")


@dataclass(frozen=True)
class ContactInfo:
    """What is said of a pair.

    Attributes:
        kind: one of KINDS, or UNKNOWN.
        peak: largest force since the message before, of a spring [N]; None: not given.
    """

    kind: str
    peak: float | None = None


def text(body_a: str, body_b: str, kind: str, peak: float | None = None) -> str:
    """For the message, e.g. "penalty contact of a::x on b::y; peak 152.3 N"."""
    return f"{kind} contact of {body_a} on {body_b}" + ("" if peak is None else f"; peak {peak:.6g} N")


def read(info: str) -> ContactInfo:
    """From the message."""
    found = _FORM.match(info)
    if found is None:
        return ContactInfo(UNKNOWN)
    return ContactInfo(found["kind"], None if found["peak"] is None else float(found["peak"]))
