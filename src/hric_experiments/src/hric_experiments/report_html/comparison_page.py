"""The page of two or more runs of the same motion, laid over each other from their first set point on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_experiments import analysis, comparison
from hric_experiments.comparison import Comparison
from hric_experiments.report_html import page, run_page, run_plots, tables
from hric_experiments.report_html.curves import Curve, Panel, Plot
from hric_experiments.report_html.page import Page
from hric_experiments.report_html.run_page import RunData
from hric_experiments.report_html.scene import Robot
from hric_experiments.report_html.tables import Table, number

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Laid:
    """One of the runs.

    Attributes:
        data: the run.
        label: what to call it.
        columns: its column for each joint of the first run.
        zero: its run time at which the page's time is 0 [s].
        compared: with the first run; None: it is the first.
    """

    data: RunData
    label: str
    columns: list[int]
    zero: float
    compared: Comparison | None

    @cached_property
    def time(self) -> FloatArray:
        """Of its cycles, on the page, shape (n,) [s]."""
        return self.data.record.log.time - self.zero


def lay(runs: Sequence[RunData], labels: Sequence[str], *, fit: bool = False) -> list[Laid]:
    """Lay runs over the first of them.

    Args:
        runs: two or more.
        labels: one per run.
        fit: by their positions, see `comparison.overlay`.

    Raises:
        ComparisonError: a run has other joints or other set points than the first.
    """
    first, orders = runs[0], analysis.joint_orders(runs[0].run)
    zero, found = float(first.record.log.time[0]), []
    for data, label in zip(runs[1:], labels[1:], strict=True):
        laid = comparison.overlay(first.record, data.record, orders, analysis.joint_orders(data.run), fit=fit)
        zero = laid.overlays[0].start_a
        order = comparison.columns(first.record.log.joint_names, data.record.log.joint_names)
        found.append(Laid(data, label, order, laid.overlays[0].start_b, laid))
    return [Laid(first, labels[0], list(range(len(first.record.log.joint_names))), zero, None), *found]


def build(laid: Sequence[Laid], settings: Sequence[Mapping[str, Any]]) -> Page:
    """What the page shows.

    Args:
        laid: the runs, the first one first.
        settings: what they set differently: key, and values in the order of the runs.
    """
    notes = ["Each run's own page shows its sensors, its limits and its parameters."]
    duration = max(float(np.ptp(one.time)) for one in laid)
    rate = page.replay_rate(duration, sum(run_page.width(one.data) for one in laid))
    head = [_overview(laid)]
    if settings:
        rows = tuple((item["key"], *("not set" if value is None else str(value) for value in item["values"])) for item in settings)
        head.append(Table("Set differently", ("key", *(one.label for one in laid)), rows))
    return Page(
        title=" and ".join(one.label for one in laid),
        subtitle="runs of the same motion, laid over each other",
        verdicts=[("plain", f"{one.label}: {one.data.run.get('status', '')}") for one in laid],
        head=head,
        plots=[_positions(laid), *_torques(laid), _differences(laid), *_paths(laid)],
        tables=[*(table for one in laid[1:] for table in _difference_tables(laid[0].label, one)), _events(laid)],
        robots=[_robot(one, k, rate, notes) for k, one in enumerate(laid) if one.data.description],
        notes=notes,
        time_title="time since the first set point [s]" if laid[0].data.moves else "time since the begin [s]",
    )


def differing(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Keys of experiments that the runs set differently, with the value in each; runs: trees of plain values."""
    found: dict[str, None] = {}
    for run in runs[1:]:
        found |= dict.fromkeys(item["key"] for item in comparison.settings(runs[0], run))
    leaves = [comparison.leaves(run) for run in runs]
    return [{"key": key, "values": [one.get(key) for one in leaves]} for key in found]


def _overview(laid: Sequence[Laid]) -> Table:
    columns = [{key: value for key, value in tables.overview(one.data.run, one.data.values).rows} for one in laid]
    keys = ("experiment", "status", "arguments", "seed", "robot", "started, finished", "run time", "hash of the states")
    rows = [("run", *(one.data.folder.path.name for one in laid)), *((key, *(column[key] for column in columns)) for key in keys)]
    return Table("", ("what", *(one.label for one in laid)), tuple(rows))


def _positions(laid: Sequence[Laid]) -> Plot:
    panels, first = [], laid[0].data
    for j, name in enumerate(first.record.log.joint_names):
        curves = []
        if first.moves:
            time, target = run_plots.set_point_line(first.record.log, first.moves, j)
            curves.append(Curve("set point", "wanted", time - laid[0].zero, target))
        for k, one in enumerate(laid):
            curves.append(Curve(one.label, f"s{k}", one.time, one.data.record.log.position[:, one.columns[j]]))
        panels.append(Panel(name, tuple(curves)))
    return Plot("positions", "Joint positions", "position [rad]", tuple(panels), least=0.02)


def _torques(laid: Sequence[Laid]) -> list[Plot]:
    """Of the joints whose torque a run commands; nothing where none does."""
    panels = []
    for j, name in enumerate(laid[0].data.record.log.joint_names):
        logs = [(k, one, one.data.record.log) for k, one in enumerate(laid)]
        able = [(k, one, log) for k, one, log in logs if log.interfaces[one.columns[j]] == "effort"]
        curves = tuple(Curve(one.label, f"s{k}", one.time, log.command[:, one.columns[j]]) for k, one, log in able)
        if curves:
            panels.append(Panel(name, curves))
    return [Plot("torques", "Torques sent", "torque [N m]", tuple(panels), least=0.2)] if panels else []


def _differences(laid: Sequence[Laid]) -> Plot:
    panels = []
    spans = {k: _span(one) for k, one in enumerate(laid) if one.compared is not None}
    for j, name in enumerate(laid[0].data.record.log.joint_names):
        curves = []
        for k, one in enumerate(laid):
            if one.compared is not None:
                values = np.concatenate([part.position_a[:, j] - part.position_b[:, j] for part in one.compared.overlays])
                curves.append(Curve(f"{laid[0].label} minus {one.label}", f"s{k}", spans[k], values))
        panels.append(Panel(name, tuple(curves)))
    return Plot("differences", "Differences of the positions", "difference [rad]", tuple(panels), least=1e-6)


def _span(one: Laid) -> FloatArray:
    """Times of the parts that both runs have, on the page."""
    assert one.compared is not None
    parts = one.compared.overlays
    return np.concatenate([part.time + part.start_a - parts[0].start_a for part in parts])


def _paths(laid: Sequence[Laid]) -> list[Plot]:
    """Distance of the end effector from the marker, for runs that followed one."""
    found = [(k, one, plot) for k, one in enumerate(laid) for plot in run_plots.tracking_plot(one.data.followed)]
    if len(found) != len(laid):
        return []
    panels = []
    for number_of_panel, panel in enumerate(found[0][2].panels):
        curves = []
        for k, one, plot in found:
            last = plot.panels[number_of_panel].curves[-1]
            curves.append(Curve(one.label, f"s{k}", last.time - one.zero, last.values))
        title = panel.title if panel.curves[-1].role == "measured" else "distance from the marker, after the lag of each run [mm]"
        panels.append(Panel(title, tuple(curves)))
    return [Plot("tracking", "The end effectors follow the marker", "", tuple(panels), least=0.002)]


def _difference_tables(first: str, one: Laid) -> list[Table]:
    assert one.compared is not None
    found = []
    for move in comparison.difference_metrics(one.compared):
        efforts = any("effort_peak_difference" in joint for joint in move["joints"].values())
        head = ["joint", "peak [rad]", "at [s]", "steady [rad]", "rms [rad]"]
        kinds = ["", "effort_"] if efforts else [""]
        head += ["torque, peak [N m]", "at [s]", "steady [N m]", "rms [N m]"] if efforts else []
        keys = [f"{kind}{key}" for kind in kinds for key in ("peak_difference", "peak_time", "steady_difference", "rms_difference")]
        rows = tuple((name, *(number(joint.get(key), 3) for key in keys)) for name, joint in move["joints"].items())
        since = f"from the set point at {move['time_a']:.3f} s on" if one.data.moves else "from the begin on"
        found.append(Table(f"{first} minus {one.label}, {since}, {move['duration']:.3f} s long", tuple(head), rows))
    return found


def _events(laid: Sequence[Laid]) -> Table:
    every = [(event.time - one.zero, one.label, event) for one in laid for event in run_page.events(one.data)]
    every.sort(key=lambda item: item[0])
    shown = every[: tables.SHOWN_EVENTS]
    rows = tuple((f"{time:.3f}", label, event.kind, event.source, event.text) for time, label, event in shown)
    note = "" if len(shown) == len(every) else f"The first {len(shown)} of {len(every)}."
    return Table("Events", ("time [s]", "run", "what", "of", "text"), rows, note, times=tuple(time for time, _, _ in shown))


def _robot(one: Laid, number_of_run: int, rate: float, notes: list[str]) -> Robot:
    return run_page.robot(one.data, rate, notes, label=one.label, role=f"s{number_of_run}", shift=-one.zero)
