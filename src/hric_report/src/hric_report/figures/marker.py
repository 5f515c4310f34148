"""Figures of marker tracking: the end effector follows a marker, over time and in space."""

from dataclasses import replace

import numpy as np

from hric_analysis.tracking import STEP
from hric_analysis.tracking_record import States
from hric_analysis.tracking_run import MarkerTracking
from hric_report import sections
from hric_report.figure import AXES, Curve, Figure, FloatArray, Panel, path, per_joint
from hric_report.figures import FigureData

PATH = "Path seen along each axis, with the marker shifted by the lag; all axes have the same scale."


def figures(data: FigureData) -> list[Figure]:
    """Return the figures of marker tracking; empty if the robot followed no marker."""
    return tracking_figures(data.followed)


def tracking_figures(tracking: MarkerTracking | None) -> list[Figure]:
    """Return the figures of marker tracking over time and in space; `tracking` is None: no marker was followed."""
    if tracking is None or tracking.data is None:
        return []
    data, record = tracking.data, tracking.record
    lag = round((tracking.values.lag or 0.0) / STEP)
    names = [f"{axis} in {record.base}" for axis in AXES]
    curves = _followed(tracking, data.desired(0))
    caption = (
        "Position of the marker and of the end effector, each relative to its position when following began, and the "
        "desired position of the controller. Last panel: distance of the end effector from where the marker was "
        f"{1e3 * lag * STEP:.0f} ms earlier, the lag that fits best."
    )
    over_time = per_joint("tracking", "The end effector follows the marker", "position [m]", names, curves)
    over_time = over_time.about(sections.TRACKING, caption)
    error = Curve("actual", "measured", data.time, 1e3 * np.linalg.norm(data.error(lag), axis=1))
    distance = Panel(f"error after the lag of {1e3 * lag * STEP:.0f} ms", (error,), unit="error [mm]")
    panels, bands = (*over_time.panels, distance), _losses(record.states)
    in_space = path(
        "tracking_path", f"Path of the end effector in {record.base}", _followed(tracking, data.desired(lag))
    ).about(sections.TRACKING, PATH)
    return [replace(over_time, panels=panels, bands=bands, min_height=0.02), in_space]


def _followed(tracking: MarkerTracking, marker: FloatArray) -> list[Curve]:
    """Return the position curves of marker, desired and actual end effector, values of shape (n, 3) [m]."""
    assert tracking.data is not None
    states, time = tracking.record.states, tracking.data.time
    return [
        Curve("marker, from the origins", "setpoint", time, marker),
        Curve("desired", "desired", states.time, states.desired),
        Curve("actual", "measured", time, tracking.data.ee),
    ]


def _losses(states: States) -> tuple[tuple[str, float, float], ...]:
    """Return the time spans (name, begin [s], end [s]) in which the controller had lost the marker."""
    lost = np.array([0, *(word == "lost" for word in states.tracking), 0], dtype=int)
    begins, ends = np.flatnonzero(np.diff(lost) > 0), np.flatnonzero(np.diff(lost) < 0)
    last = len(states.time) - 1
    return tuple(
        ("marker lost", float(states.time[begin]), float(states.time[min(int(end), last)]))
        for begin, end in zip(begins, ends, strict=True)
    )
