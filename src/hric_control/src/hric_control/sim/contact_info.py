"""Text of `ContactState.info` on `sim/contacts`: kind of contact between a pair of bodies, and its peak force. No ROS.

The kind says if the force is comparable with a sensor's reading."""

import re
from dataclasses import dataclass

KINDS = ("rigid", "penalty")
UNKNOWN = "unknown"
"""Kind of a contact without an `info`, as in older bags."""
_FORM = re.compile(r"(?P<kind>rigid|penalty) contact of \S+ on [^\s;]+(; peak (?P<peak>[-+.\deE]+) N)?")


@dataclass(frozen=True)
class ContactInfo:
    """Content of `ContactState.info` for a pair of bodies.

    Attributes:
        kind: one of KINDS, or UNKNOWN.
        peak: largest penalty force since the last message [N]; None: not in the text.
    """

    kind: str
    peak: float | None = None


def text(body_a: str, body_b: str, kind: str, peak: float | None = None) -> str:
    """Return the text for the message, e.g. "penalty contact of a::x on b::y; peak 152.3 N"."""
    return f"{kind} contact of {body_a} on {body_b}" + ("" if peak is None else f"; peak {peak:.6g} N")


def read(info: str) -> ContactInfo:
    """Return the content of a message's `info`."""
    match = _FORM.match(info)
    if match is None:
        return ContactInfo(UNKNOWN)
    return ContactInfo(match["kind"], None if match["peak"] is None else float(match["peak"]))
