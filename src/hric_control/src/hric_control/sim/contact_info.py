"""Text in `ContactState.info` on the topic `sim/contacts`: kind of a contact between two bodies, and its peak force.

Only the force of a "penalty" contact is comparable with a sensor's reading, that of a "rigid" one is not."""

import re
from dataclasses import dataclass

KINDS = ("rigid", "penalty")
UNKNOWN = "unknown"
"""Kind of a contact if the message has no `info`, as in older bags."""
_FORM = re.compile(r"(?P<kind>rigid|penalty) contact of \S+ on [^\s;]+(; peak (?P<peak>[-+.\deE]+) N)?")


@dataclass(frozen=True)
class ContactInfo:
    """Content of the text `ContactState.info` for the contact of two bodies.

    Attributes:
        kind: "rigid", "penalty" or "unknown".
        peak: largest penalty contact force since the last message [N]; None: not in the text.
    """

    kind: str
    peak: float | None = None


def text(body_a: str, body_b: str, kind: str, peak: float | None = None) -> str:
    """Return the text for `ContactState.info`, e.g. "penalty contact of a::x on b::y; peak 152.3 N"."""
    return f"{kind} contact of {body_a} on {body_b}" + ("" if peak is None else f"; peak {peak:.6g} N")


def read(info: str) -> ContactInfo:
    """Return the content of the text `ContactState.info`."""
    match = _FORM.match(info)
    if match is None:
        return ContactInfo(UNKNOWN)
    return ContactInfo(match["kind"], None if match["peak"] is None else float(match["peak"]))
