"""Charts with rows of bars over time ("strips"), drawn by `strip.html`; a click on a bar sets the replay's time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from hric_report.html.chart import Axis

LEFT, WIDTH = 120.0, 640.0
"""Width of the row labels, and of a chart including its labels [units of the picture]."""


class StripBar(NamedTuple):
    """Bar from begin to end [s], with index of its row, CSS class and tooltip."""

    begin: float
    end: float
    row: int
    look: str
    text: str


@dataclass(frozen=True)
class Strip:
    """Chart with rows of bars, or an image, over time.

    Attributes:
        name: name of the chart.
        title: title for the reader.
        labels: labels of the rows.
        axis: time axis [s].
        bars: bars, the last one on top.
        key: legend: CSS class and meaning of each colour.
        image: PNG as base64 that fills all rows; "": no image.
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
    """Return the time axis of a chart, from begin to end [s]."""
    return Axis(float(begin), float(end), LEFT, WIDTH)
