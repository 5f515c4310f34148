"""Marker tracking in the runs of a study: comparison table and figure."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hric_analysis import tracking_run as tracking_analysis
from hric_analysis.tracking import STEP
from hric_analysis.tracking_run import Tracking
from hric_bags import reader as bag_reader
from hric_bags import text as text_table
from hric_bags.run_folder import RunFolder
from hric_report.figure import Curve, Figure, Panel
from hric_report.run import bag_of

SHOWN = ("lag", "rms_error", "largest_error", "losses", "ignored")


def chosen(metrics: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the metrics of a run in which tracking runs differ; None if no marker was tracked."""
    values = metrics.get("tracking")
    if not values:
        return None
    ratio = (values["acceleration"] or {}).get("ratio")
    return {**{key: values[key] for key in SHOWN}, "acceleration_ratio": ratio, "reflexes": len(metrics["reflexes"])}


def lines(runs: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the table of these values, one line per run; empty if no marker was tracked."""
    cells = [
        [
            "following the marker",
            "lag [ms]",
            "rms error [mm]",
            "largest [mm]",
            "acceleration of ideal",
            "markers ignored",
            "reflexes",
        ]
    ]
    for name, run in runs.items():
        if values := run.get("tracking"):
            lengths = [
                _scaled(values[key], 1e3, digits)
                for key, digits in (("lag", 1), ("rms_error", 2), ("largest_error", 2))
            ]
            cells.append(
                [
                    name,
                    *lengths,
                    _scaled(values["acceleration_ratio"], 1.0, 2),
                    str(values["ignored"]),
                    str(values["reflexes"]),
                ]
            )
    return ["", *text_table.rows(cells)] if len(cells) > 1 else []


def _scaled(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else f"{factor * value:.{digits}f}"


def figure(runs: Mapping[str, RunFolder]) -> Figure | None:
    """Return the figure `tracking`, one column per run, or None if no marker was tracked.

    At the top is the axis that moved most, at the bottom the error after compensation of the lag.
    """
    found = {name: part for name, run in runs.items() if (part := _tracking(run)) is not None and part.data is not None}
    if not found:
        return None
    columns = [_column(name, part) for name, part in found.items()]
    caption = "Above: the axis that moved most. Below: distance from where the marker was one lag before."
    panels = tuple(panel for row in zip(*columns, strict=True) for panel in row)
    return Figure(
        "tracking", "The end effector follows the marker", "", panels, 0.02, columns=len(columns), caption=caption
    )


def _tracking(folder: RunFolder) -> Tracking | None:
    run = folder.read()
    bag = bag_of(folder, run)
    return tracking_analysis.analyse(folder.description(), bag, run, bag_reader.read(bag))


def _column(name: str, part: Tracking) -> tuple[Panel, Panel]:
    data, states, values = part.data, part.record.states, part.values
    assert data is not None
    axis = int(np.argmax(np.ptp(data.marker, axis=0)))
    lag = round((values.lag or 0.0) / STEP)
    curves = (
        Curve("marker, from the origins", "setpoint", data.time, data.desired(0)[:, axis]),
        Curve("desired", "desired", states.time, states.desired[:, axis]),
        Curve("actual", "measured", data.time, data.ee[:, axis]),
    )
    error = Curve("actual", "measured", data.time, 1e3 * np.linalg.norm(data.error(lag), axis=1))
    return (
        Panel(f"{name}: lag {lag * STEP * 1e3:.0f} ms", curves, unit=f"{'xyz'[axis]} in {part.record.base} [m]"),
        Panel(f"rms error {1e3 * (values.rms_error or 0.0):.2f} mm", (error,), unit="error [mm]"),
    )
