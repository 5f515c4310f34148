"""HTML page of a trial: one file that needs no network and no JavaScript."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hric_core.geometry import FloatArray
from hric_motion.measured import MAX_DISTANCE
from hric_motion.moments import JointMoments, intervals
from hric_motion.stances import NORMAL
from hric_motion.trial import TrialMotion
from hric_report.html import templates
from hric_report.html.chart import Axis, ticks
from hric_report.html.table import PageTable, number
from hric_report.html.tables import flat
from hric_report.trial import emg, summary

ASSETS = Path(__file__).parent / "assets"
LEFT, RIGHT, TOP, BOTTOM = 40.0, 370.0, 8.0, 118.0
"""Ends of the axes of a panel [px]."""
WIDE = 760.0
"""Right end of the horizontal axis of wide panels [px]."""
POINTS = 400
"""Largest number of points of a drawn curve; of a longer one only every second, third, ... frame is drawn."""
LINES = (
    *(summary.fit_line, summary.known_line, summary.moment_line),
    *(summary.lumbar_line, summary.handover_line, summary.subject_line),
)
"""Functions that return the sentences at the top of the page, of the content of trial.json."""


@dataclass(frozen=True)
class PanelPlot:
    """Curve over time with a band, as SVG paths.

    Attributes:
        title: title above the panel.
        x, y: horizontal and vertical axis.
        line, band: SVG paths of the curve and of the band around it, with gaps where the values are not known.
        second: SVG path of another curve; "": there is none.
        limit: value at which a horizontal line is drawn; None: there is none.
    """

    title: str
    x: Axis
    y: Axis
    line: str
    band: str = ""
    second: str = ""
    limit: float | None = None

    @property
    def marks(self) -> list[float]:
        """Values of the ticks of the vertical axis, which are round numbers."""
        return ticks(self.y.low, self.y.high, 3)


def build(
    result: TrialMotion, moments: JointMoments | None, activity: emg.TrialEmg | None, values: Mapping[str, Any]
) -> str:
    """Return the HTML page of a trial; values: content of trial.json."""
    files = ", ".join(f"{role}: {file['name']}" for role, file in values["files"].items())
    markers = sorted(values["markers"].items(), key=lambda item: -(item[1]["after"] or 0.0))
    known = {name: one for name, one in values["joints"].items() if one["known"]}
    longest = max(float(summary.before(values).max()), MAX_DISTANCE)
    return (
        templates.environment(ASSETS)
        .get_template("trial.html")
        .render(
            title=values["files"]["motion"]["name"] + (f", {result.prefix}" if result.prefix else ""),
            subtitle=f"{files}; {values['marker_set']}, {values['frames']} frames at {values['rate']:g} Hz",
            verdicts=_labels(values),
            foot="Joint angles and moments are estimates of a model that was fitted to the markers.",
            lines=[text for line in LINES if (text := line(values))],
            unknown=_unknown(values),
            markers=markers,
            bars=Axis(0.0, 1e3 * longest, 80.0, WIDE),
            residual=_panel("", result.time, 1e3 * result.motion.residual, right=WIDE, limit=1e3 * MAX_DISTANCE),
            angles=list(_angles(result, list(known))),
            moments=[] if moments is None else list(_moments(moments)),
            moment_notes=[] if moments is None else moments.notes,
            activations=[] if activity is None else list(_activations(activity)),
            emg_lines=emg.lines(values),
            tables=list(_tables(values)),
            notes=values["notes"],
        )
    )


def _labels(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    unknown, fitted = len(values["unknown"]), values["fitted"]
    return [
        ("good" if fitted == 1.0 else "warning", f"fits in {100.0 * fitted:.0f} % of the frames"),
        ("warning", f"{unknown} joints not known") if unknown else ("good", "all joints known"),
    ]


def _unknown(values: Mapping[str, Any]) -> PageTable:
    rows = [(name, f"{100.0 * one['known']:.0f} %", one["reason"]) for name, one in values["joints"].items()]
    shown = tuple(row for row in rows if row[2])
    return PageTable("Joints that are not always known", ("joint", "frames in which it is known", "why"), shown)


def _angles(result: TrialMotion, names: list[str]) -> Iterator[PanelPlot]:
    columns = list(result.motion.body.joints)
    for name in names:
        column = columns.index(name)
        q, half = result.motion.q[:, column], NORMAL * result.motion.spread[:, column]
        yield _panel(f"{name} [deg]", result.time, np.degrees(q), np.degrees(half))


def _moments(moments: JointMoments) -> Iterator[PanelPlot]:
    for name, values, half in zip(moments.body.joints, moments.moment.T, moments.half_width.T, strict=True):
        if np.isfinite(values).any():
            yield _panel(f"{name} [N m]", moments.motion.time, values, half)


def _activations(activity: emg.TrialEmg) -> Iterator[PanelPlot]:
    for one in activity.channels:
        if not one.reason:
            title = f"{one.label}: {one.muscle} [{one.reference}]"
            yield _panel(title, activity.time, one.measured, other=one.estimated)


def _panel(
    title: str,
    times: FloatArray,
    values: FloatArray,
    half: FloatArray | None = None,
    right: float = RIGHT,
    limit: float | None = None,
    other: FloatArray | None = None,
) -> PanelPlot:
    """Return the plot of values at times [s], shape (n,) each.

    half: half of the width of the band, shape (n,), None: no band; right: right end of the axis [px]; limit: value of a
    horizontal line, None: no line; other: values of another curve, shape (n,), None: no curve."""
    rows = slice(None, None, max(1, -(-len(values) // POINTS)))
    time, values = times[rows], values[rows]
    spread = np.zeros(len(values)) if half is None else half[rows]
    low, high = float(np.nanmin(values - spread)), float(np.nanmax(values + spread))
    if half is None:
        low, high = 0.0, max(high, limit or 0.0, 0.0 if other is None else float(np.nanmax(other))) * 1.05
    x, y = Axis(float(time[0]), float(time[-1]), LEFT, right), Axis(low, high, BOTTOM, TOP)
    lines, bands = list[str](), list[str]()
    second = "" if other is None else "".join(_curves(time, other[rows], x, y))
    for run, line in zip(intervals(np.isfinite(values)), _curves(time, values, x, y), strict=True):
        lines.append(line)
        if half is not None:
            upper = [(x.x(t), y.x(v)) for t, v in zip(time[run], (values + spread)[run], strict=True)]
            lower = [(x.x(t), y.x(v)) for t, v in zip(time[run], (values - spread)[run], strict=True)]
            bands.append(f"{_path([*upper, *lower[::-1]])}Z")
    return PanelPlot(title, x, y, "".join(lines), "".join(bands), second, limit)


def _curves(time: FloatArray, values: FloatArray, x: Axis, y: Axis) -> Iterator[str]:
    for run in intervals(np.isfinite(values)):
        yield _path([(x.x(t), y.x(value)) for t, value in zip(time[run], values[run], strict=True)])


def _path(points: list[tuple[float, float]]) -> str:
    return "M" + " ".join(f"{px:.1f} {py:.1f}" for px, py in points)


def _tables(values: Mapping[str, Any]) -> Iterator[PageTable]:
    joints = tuple(
        (name, *(number(one[key], 3) for key in ("low", "high", "deviation")), f"{100.0 * one['known']:.0f} %")
        for name, one in values["joints"].items()
    )
    yield PageTable("Joint angles", ("joint", "smallest [deg]", "largest [deg]", "deviation [deg]", "known"), joints)
    differences = tuple(
        (name, one["angle"], str(one["frames"]), *(f"{one[key]:.1f}" for key in ("rms", "offset", "varying")))
        for name, one in values["vendor"].items()
    )
    yield PageTable(
        "Difference from the angles in the file",
        ("joint", "angle in the file", "frames", "RMS [deg]", "mean [deg]", "RMS without the mean [deg]"),
        differences,
    )
    moved = (values["moments"] or {"joints": {}})["joints"]
    loads = tuple(
        (name, *(number(one[key], 3) for key in summary.ENDS), f"{100.0 * one['known']:.0f} %")
        for name, one in moved.items()
    )
    columns = "lower end (95 %) [N m]", "smallest [N m]", "largest [N m]", "upper end (95 %) [N m]"
    yield PageTable("Joint moments", ("joint", *columns, "known"), loads)
    lengths = tuple(
        (name, f"{one['table']:.3f}", f"{one['fitted']:.3f}", f"{100 * (one['fitted'] / one['table'] - 1):+.1f} %")
        for name, one in values["lengths"].items()
    )
    yield PageTable("Lengths", ("length", "by the table [m]", "fitted [m]", "change"), lengths)
    labels = tuple((name, one["label"] or "in the static trial") for name, one in values["markers"].items())
    yield PageTable("Labels", ("marker", "label"), labels, folded=True)
    made = {key: values[key] for key in ("files", "command", "subject", "versions", "revision") if values[key]}
    yield PageTable("Files and versions", ("what", "value"), tuple(flat(made)), folded=True)
