"""Table of NatNet's fields and the bitstreams (protocol versions) that have them.

No other code depends on the version.

Sources: public captures of Motive sessions (2.5 to 3.0) and what several independent public decoders agree on (3.0 to
4.2). Later bitstreams are read as 4.2.
"""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from struct import Struct

from mocap_natnet.codec.reader import CodecError
from mocap_natnet.codec.types import Suffix

Version = tuple[int, int]
"""Major and minor number of a bitstream; 2.10 is (2, 10) and later than (2, 9)."""

FIRST: Version = (2, 5)
LAST: Version = (4, 5)
"""Oldest and newest bitstream that can be read."""
NEWEST_KNOWN: Version = (4, 2)
"""Newest bitstream whose layout is known; later ones are read by section sizes, and unknown tails are skipped."""

SINCE: dict[str, Version] = {
    "body_flags": (2, 6),
    "marker_flags": (2, 6),
    "frame_flags": (2, 6),
    "time_stamp": (2, 6),
    "time_stamp_double": (2, 7),
    "force_plates": (2, 9),
    "devices": (2, 11),
    "residual": (3, 0),
    "ticks": (3, 0),
    "clock_frequency": (3, 0),
    "marker_names": (4, 0),
    "sizes": (4, 1),
    "assets": (4, 1),
    "precision_time": (4, 1),
    "rotation_offset": (4, 2),
}
"""Field -> first bitstream that has it. Skeletons and labelled markers are in all bitstreams that can be read."""
UNTIL: dict[str, Version] = {"body_markers": (3, 0), "latency": (3, 0)}
"""Field -> first bitstream that lacks it.

The fields are the markers of a body within the frame (in the description from 3.0 on), and the software latency.
"""


@dataclass(frozen=True)
class BitstreamLayout:
    """Layout of a bitstream.

    Attributes:
        version: version of the bitstream.
        has: True for each field of SINCE and UNTIL that the bitstream has.
        tail_known: True if the layout is known completely, so that bytes after it are an error of the stream.
        body: format of a rigid body without markers: id, position, orientation, mean error, flags.
        body_tail: format of the fields after the markers of a body: mean error, flags.
        marker: format of a labelled marker.
        suffix: format of the fields after the last section.
        suffix_fields: names of the suffix' fields, in order.
        plain_suffix: True if the suffix has all fields of `Suffix` except the latency, and the end tag.
    """

    version: Version
    has: Mapping[str, bool]
    tail_known: bool
    body: Struct
    body_tail: Struct
    marker: Struct
    suffix: Struct
    suffix_fields: tuple[str, ...]
    plain_suffix: bool


@functools.cache
def layout(version: Version) -> BitstreamLayout:
    """Return the layout of a bitstream. Raises CodecError if the bitstream is not known."""
    if not FIRST <= version <= LAST:
        raise CodecError("version", f"bitstream {text(version)}; this codec reads {text(FIRST)} to {text(LAST)}")
    flags = {name: version >= since for name, since in SINCE.items()} | {
        name: version < until for name, until in UNTIL.items()
    }
    fields = _suffix_fields(flags)
    return BitstreamLayout(
        version=version,
        has=flags,
        tail_known=version <= NEWEST_KNOWN,
        body=Struct("<i3f4ff" + "h" * flags["body_flags"]),
        body_tail=Struct("<f" + "h" * flags["body_flags"]),
        marker=Struct("<i3ff" + "h" * flags["marker_flags"] + "f" * flags["residual"]),
        suffix=Struct("<" + "".join(fields.values())),
        suffix_fields=tuple(fields),
        plain_suffix=tuple(fields) == (*Suffix._fields[1:], "end_tag"),
    )


def _suffix_fields(flags: dict[str, bool]) -> dict[str, str]:
    """Return names and struct letters of the suffix' fields, in their order."""
    fields = {"latency": "f"} if flags["latency"] else {}
    fields |= {"time_code": "I", "time_code_subframe": "I"}
    if flags["time_stamp"]:
        fields["time_stamp"] = "d" if flags["time_stamp_double"] else "f"
    if flags["ticks"]:
        fields |= {"mid_exposure": "Q", "received": "Q", "transmitted": "Q"}
    if flags["precision_time"]:
        fields |= {"precision_seconds": "I", "precision_fraction": "I"}
    if flags["frame_flags"]:
        fields["flags"] = "h"
    return fields | {"end_tag": "i"}


def text(version: Version) -> str:
    """Return the version as text, such as "4.1"."""
    return f"{version[0]}.{version[1]}"


def parse(words: str) -> Version:
    """Return the bitstream of a text such as "4.1" or "4.1.0.0". Raises CodecError."""
    match = re.fullmatch(r"(\d{1,3})\.(\d{1,3})(\.\d{1,3}){0,2}", words.strip())
    if not match:
        raise CodecError("version", f"bitstream {words!r}; valid: major.minor, e.g. 4.1")
    return int(match[1]), int(match[2])
