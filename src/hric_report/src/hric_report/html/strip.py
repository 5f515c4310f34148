"""Strips of bars over time, which `strip.html` draws; a click on a bar shows its start in the replay."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from hric_report.html.chart import Axis

LEFT, WIDTH = 120.0, 640.0
"""Width of the labels, and of a strip with its labels [units of the picture]."""


class StripBar(NamedTuple):
    """Bar from begin to end [s], with its row, CSS class and tooltip."""

    begin: float
    end: float
    row: int
    look: str
    text: str


@dataclass(frozen=True)
class Strip:
    """Rows of bars, or an image, over time.

    Attributes:
        name: name of the strip.
        title: title for the reader.
        labels: labels of the rows.
        axis: time axis [s].
        bars: bars, the last one on top.
        key: CSS class and meaning of each colour.
        image: PNG as base64 that fills all rows; "": none.
        row: height of a row [units of the picture].
    """

    name: str
    title: str
    labels: Sequence[str]
    axis: Axis
    bars: Sequence[StripBar] = ()
    key: Sequence[tuple[str, str]] = ()
    image: str = ""
    row: float = 20.0


def time_axis(begin: float, end: float) -> Axis:
    """Return the time axis of a strip from begin to end [s]."""
    return Axis(float(begin), float(end), LEFT, WIDTH)
