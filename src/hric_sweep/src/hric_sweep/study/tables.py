"""Tables of a study: metrics of each run on marker tracking and on the human, and figures of these metrics."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hric_analysis import human_values, tracking_run
from hric_analysis.tracking import STEP
from hric_analysis.tracking_run import MarkerTracking
from hric_bags import reader as bag_reader
from hric_bags import text as text_table
from hric_bags.run_folder import RunFolder
from hric_report import sections
from hric_report.figure import Curve, Figure, Panel
from hric_run.definition.parameters import HUMAN
from hric_sweep.outputs import SweepOutput
from hric_sweep.records import PlainData


class TableColumn(NamedTuple):
    """Table column: a metric of each run.

    Attributes:
        heading: heading with the unit of the printed numbers.
        form: format of the printed numbers.
        path: path of the number in metrics.json of a run; empty: the share of the weight that the hand carries.
        reduce: reduction of several values to one, see `SweepOutput`.
        factor: factor from the number in metrics.json to the printed one.
    """

    heading: str
    form: str
    path: str
    reduce: str = "max"
    factor: float = 1.0


TRACKING_COLUMNS = {
    "lag": TableColumn("lag [ms]", ".1f", "tracking.lag", factor=1e3),
    "rms_error": TableColumn("rms error [mm]", ".2f", "tracking.rms_error", factor=1e3),
    "largest_error": TableColumn("largest [mm]", ".2f", "tracking.largest_error", factor=1e3),
    "acceleration_ratio": TableColumn("acceleration / ideal", ".2f", "tracking.acceleration.ratio"),
    "ignored": TableColumn("markers ignored", ".0f", "tracking.ignored"),
    "losses": TableColumn("markers lost", ".0f", "tracking.losses"),
    "reflexes": TableColumn("reflexes", ".0f", "reflexes.*", "count"),
}
"""Columns for runs in which the robot follows a marker, by name."""
HUMAN_COLUMNS = {
    "grip_force_max": TableColumn("largest grip force [N]", ".2f", "human.grips.*.force_max"),
    "grip_work": TableColumn("work on the object [J]", ".3f", "human.grips.*.work", "sum"),
    "grip_work_absolute": TableColumn("absolute work [J]", ".3f", "human.grips.*.work_absolute", "sum"),
    "load_share": TableColumn("share of the weight that the hand carries [1]", ".3f", ""),
    "squeeze_max": TableColumn("largest squeeze [N]", ".2f", "human.carried.0.squeeze_max"),
    "stretch_max": TableColumn("largest stretch [N]", ".2f", "human.carried.0.stretch_max"),
    "tilt_max": TableColumn("largest tilt [rad]", ".3f", "human.carried.0.tilt_max"),
    "path": TableColumn("path of the hand [m]", ".3f", "human.hand.path"),
    "strength_share_max": TableColumn("largest share of a joint's strength [1]", ".3f", "human.strength_share_max"),
    "activation_max": TableColumn("largest activation of a muscle [1]", ".3f", "human.muscles.activation_max"),
    "activation_mean": TableColumn("mean activation of all muscles [1]", ".4f", "human.muscles.activation_mean"),
    "smoothness": TableColumn("log dimensionless jerk [1]", ".2f", "human.hand.smoothness"),
}
"""Columns for runs with a human, by name; a column without values is left out."""
OUTPUTS = {
    f"{name} {part}": {"path": column.path, "reduce": column.reduce}
    for part, columns in (("tracking", TRACKING_COLUMNS), ("human", HUMAN_COLUMNS))
    for name, column in columns.items()
    if column.path
}
"""Outputs of the sweep that executes a form of a study, as in a sweep file."""


def values(metrics: PlainData, part: str, columns: Mapping[str, TableColumn]) -> dict[str, float | str | None] | None:
    """Return the metrics of a run by name of the column; None: metrics.json lacks this part.

    Args:
        metrics: content of metrics.json.
        part: part of the metrics, "tracking" or "human".
        columns: columns of the part.
    """
    if not metrics.get(part):
        return None
    numbers: dict[str, float | str | None] = {}
    for name, column in columns.items():
        number = (
            SweepOutput(path=column.path, reduce=column.reduce).measured(metrics) if column.path else _share(metrics)
        )
        numbers[name] = None if np.isnan(number) else number
    if part == "human":
        settling = metrics["human"]["settling"]
        numbers["settling"] = None if settling is None else settling["verdict"]
    return numbers


def _share(metrics: PlainData) -> float:
    """Return the mean share of a carried object's weight on the human's grips [1]; NaN: nothing is carried."""
    objects, grips = metrics["human"].get("carried") or [{}], metrics["human"]["grips"]
    shares = objects[0].get("load_share") or {}
    means = [share["mean"] for name, share in shares.items() if grips[name]["holder"].startswith(f"{HUMAN}::")]
    return sum(means) if means else np.nan


def lines(runs: Mapping[str, PlainData], part: str, title: str, columns: Mapping[str, TableColumn]) -> list[str]:
    """Return the lines of a table with one line per run; empty if no run has the part.

    Args:
        runs: results of the runs, with the `values` of each part.
        part: tracking or human.
        title: heading of the first column.
        columns: columns of the part.
    """
    present = {name: run[part] for name, run in runs.items() if run.get(part)}
    if not present:
        return []
    listed = _present(list(present.values()), columns)
    after = ["after the motion"] * (part == "human")
    cells = [[title, *(column.heading for column in listed.values()), *after]]
    for name, run in present.items():
        row = [
            "-" if run[key] is None else f"{column.factor * run[key]:{column.form}}" for key, column in listed.items()
        ]
        cells.append([name, *row, *([run["settling"] or "not judged"] if after else [])])
    return ["", *text_table.rows(cells)]


def _present(runs: Sequence[PlainData], columns: Mapping[str, TableColumn]) -> dict[str, TableColumn]:
    return {key: column for key, column in columns.items() if any(run.get(key) is not None for run in runs)}


def human_figure(runs: Mapping[str, PlainData], abscissa: str) -> Figure | None:
    """Return the figure `human`: each metric over the numbers that name the runs; None without human or abscissa."""
    people = sorted((float(name), run["human"]) for name, run in runs.items() if abscissa and run.get("human"))
    if not people:
        return None
    at = np.array([x for x, _ in people])
    panels = []
    for key, column in _present([run for _, run in people], HUMAN_COLUMNS).items():
        numbers = np.array([np.nan if run[key] is None else run[key] for _, run in people], dtype=float)
        name, _, unit = column.heading.rpartition(" [")
        curves = Curve("", "measured", at, numbers), Curve("", "samples", at, numbers)
        panels.append(Panel(name, curves, unit=f"[{unit}"))
    unstable = ", ".join(f"{x:g}" for x, run in people if run["settling"] == human_values.UNSTABLE)
    caption = "Estimates from a model of the human." + f" Unstable after the motion in the runs {unstable}." * bool(
        unstable
    )
    made = Figure("human", "Load on the human", "", tuple(panels), abscissa=abscissa)
    return made.about(sections.RESULTS, caption)


def tracking_figure(runs: Mapping[str, RunFolder]) -> Figure | None:
    """Return the figure `tracking`, one column per run, or None if no marker was tracked.

    Top: the axis with the largest motion; bottom: the tracking error after compensation of the lag.
    """
    parts = {name: _tracking(run) for name, run in runs.items()}
    columns = [_panels(name, part) for name, part in parts.items() if part is not None and part.data is not None]
    if not columns:
        return None
    caption = "Top: the axis with the largest motion. Bottom: distance to where the marker was one lag earlier."
    panels = tuple(panel for row in zip(*columns, strict=True) for panel in row)
    title = "The end effector follows the marker"
    return Figure("tracking", title, "", panels, 0.02, columns=len(columns), caption=caption)


def _tracking(folder: RunFolder) -> MarkerTracking | None:
    run = folder.read()
    bag = folder.bag_of(run)
    return tracking_run.analyse(folder.description(), bag, run, bag_reader.read(bag))


def _panels(name: str, part: MarkerTracking) -> tuple[Panel, Panel]:
    data, states, numbers = part.data, part.record.states, part.values
    assert data is not None
    axis = int(np.argmax(np.ptp(data.marker, axis=0)))
    lag = round((numbers.lag or 0.0) / STEP)
    curves = (
        Curve("marker, from the origins", "setpoint", data.time, data.desired(0)[:, axis]),
        Curve("desired", "desired", states.time, states.desired[:, axis]),
        Curve("actual", "measured", data.time, data.ee[:, axis]),
    )
    error = Curve("actual", "measured", data.time, 1e3 * np.linalg.norm(data.error(lag), axis=1))
    return (
        Panel(f"{name}: lag {lag * STEP * 1e3:.0f} ms", curves, unit=f"{'xyz'[axis]} in {part.record.base} [m]"),
        Panel(f"rms error {1e3 * (numbers.rms_error or 0.0):.2f} mm", (error,), unit="error [mm]"),
    )
