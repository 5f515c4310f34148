"""Runs of a study that followed a marker: their figures side by side."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hric_bags import reader as bag_reader
from hric_bags import text as text_table
from hric_bags.run_folder import RunFolder
from hric_experiments.analysis import tracking_run as tracking_analysis
from hric_experiments.analysis.run import bag_of
from hric_experiments.analysis.tracking_run import Tracking

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = ("lag", "rms_error", "largest_error", "losses", "ignored")


def chosen(metrics: Mapping[str, Any]) -> dict[str, Any] | None:
    """Of a run's metrics those by which runs differ; None where no marker was followed."""
    values = metrics.get("tracking")
    if not values:
        return None
    ratio = (values["acceleration"] or {}).get("ratio")
    return {**{key: values[key] for key in SHOWN}, "acceleration_ratio": ratio, "reflexes": len(metrics["reflexes"])}


def lines(runs: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Table of these values, one line per run; empty where no marker was followed."""
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


def draw(folder: Path, runs: Mapping[str, RunFolder], title: str) -> Path | None:
    """`tracking.png`: one column per run, above the axis that moved most, below the error after the lag; None where no
    marker was followed."""
    found = {name: part for name, run in runs.items() if (part := _tracking(run)) is not None and part.data is not None}
    if not found:
        return None
    import matplotlib.pyplot as plt

    from hric_experiments.report.png import STYLE, legend, save

    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        margins = {"left": 0.07, "right": 0.98, "bottom": 0.14, "top": 0.88, "wspace": 0.12, "hspace": 0.22}
        figure, grid = plt.subplots(
            2,
            len(found),
            figsize=(5.5 * len(found), 5.6),
            squeeze=False,
            sharex=True,
            sharey="row",
            gridspec_kw=margins,
        )
        figure.suptitle(f"{title}: the end effector follows the marker", fontsize=12)
        for column, (name, part) in enumerate(found.items()):
            _column(grid[0][column], grid[1][column], name, part)
        grid[1][0].set_ylim(bottom=0.0)  # when all are drawn: it ends the scaling to what comes
        grid[0][0].set_ylabel("position [m]")
        grid[1][0].set_ylabel("error [mm]")
        legend(figure, list(grid[0]), len(found))
        return save(figure, folder / "tracking.png")


def _tracking(folder: RunFolder) -> Tracking | None:
    run = folder.read()
    bag = bag_of(folder, run)
    return tracking_analysis.analyse(folder, bag, run, bag_reader.read(bag))


def _column(above: Axes, below: Axes, name: str, part: Tracking) -> None:
    from hric_experiments.analysis.tracking import STEP
    from hric_experiments.report.png import DESIRED, MEASURED, SETPOINT

    data, states, values = part.data, part.record.states, part.values
    if data is None:
        return
    axis = int(np.argmax(np.ptp(data.marker, axis=0)))
    lag = round((values["lag"] or 0.0) / STEP)
    above.plot(
        data.time,
        data.desired(0)[:, axis],
        color=SETPOINT,
        linestyle="--",
        linewidth=1.0,
        label="marker, from the origins",
    )
    above.plot(states.time, states.desired[:, axis], color=DESIRED, linewidth=2.8, alpha=0.7, label="desired")
    above.plot(data.time, data.ee[:, axis], color=MEASURED, linewidth=1.0, label="actual")
    above.set_title(f"{name}: {'xyz'[axis]} in {part.record.base}, lag {lag * STEP * 1e3:.0f} ms", loc="left")
    below.plot(data.time, 1e3 * np.linalg.norm(data.error(lag), axis=1), color=MEASURED, linewidth=0.9)
    below.set_title(f"error after the lag, rms {1e3 * values['rms_error']:.2f} mm", loc="left")
    below.set_xlabel("time [s]")
