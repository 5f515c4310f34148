"""Page of two or more runs of the same motion, overlaid on each other from their first setpoint on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hric_analysis import comparison
from hric_analysis.comparison import Comparison
from hric_analysis.recordings import Event
from hric_analysis.values import RunMetrics, joint_orders
from hric_core.json_values import from_json
from hric_report import comparison_figures, headline, sections
from hric_report.figure import Curve, Figure, FloatArray, per_joint
from hric_report.figures import marker, robot
from hric_report.html import beside, moving, run_page
from hric_report.html.page import Page, replay_rate
from hric_report.html.run_data import RunData
from hric_report.html.scene import Robot


@dataclass(frozen=True)
class Laid:
    """Run that is overlaid on the first run of the page.

    Attributes:
        data: run data.
        label: label of the run.
        columns: column of each joint of the first run in this run's log.
        zero: robot time of the run at which the time of the page is 0 [s].
        compared: comparison with the first run; None: this is the first run.
    """

    data: RunData
    label: str
    columns: list[int]
    zero: float
    compared: Comparison | None

    @cached_property
    def time(self) -> FloatArray:
        """Times of the control cycles on the time axis of the page, shape (n,) [s]."""
        return self.data.record.log.time - self.zero


def lay(runs: Sequence[RunData], labels: Sequence[str], *, fit: bool = False) -> list[Laid]:
    """Overlay runs on the first of them.

    Args:
        runs: two or more runs.
        labels: labels of the runs.
        fit: align the runs by their positions, see `comparison.overlay`.

    Raises:
        ComparisonError: joints or setpoints of a run differ from those of the first.
    """
    first, orders = runs[0], joint_orders(runs[0].run)
    zero, found = float(first.record.log.time[0]), []
    for data, label in zip(runs[1:], labels[1:], strict=True):
        laid = comparison.overlay(first.record, data.record, orders, joint_orders(data.run), fit=fit)
        zero = laid.overlays[0].start_a
        order = comparison.columns(first.record.log.joint_names, data.record.log.joint_names)
        found.append(Laid(data, label, order, laid.overlays[0].start_b, laid))
    return [Laid(first, labels[0], list(range(len(first.record.log.joint_names))), zero, None), *found]


def build(laid: Sequence[Laid], settings: Sequence[Mapping[str, Any]]) -> Page:
    """Return the contents of the page.

    Args:
        laid: overlaid runs, starting with the first.
        settings: settings that differ: key, and values in the order of the runs.
    """
    notes = ["Each run's own page shows its sensors, its limits and its parameters."]
    duration = max(float(np.ptp(one.time)) for one in laid)
    rate = replay_rate(duration, sum(moving.width(one.data) + beside.width(one.data) for one in laid))
    pairs = {one.label: comparison.difference_metrics(one.compared) for one in laid if one.compared is not None}
    return Page(
        title=" and ".join(one.label for one in laid),
        subtitle="runs of the same motion, overlaid on each other",
        verdicts=[("plain", f"{one.label}: {one.data.run.get('status', '')}") for one in laid],
        findings=[*headline.of_comparison(laid[0].label, pairs), *_problems(laid)],
        figures=_figures(laid),
        compared={"laid": laid, "pairs": pairs, "settings": settings, "events": _events(laid)},
        robots=[robot for k, one in enumerate(laid) if one.data.description for robot in _robots(one, k, rate, notes)],
        notes=notes,
    )


def _problems(laid: Sequence[Laid]) -> list[headline.KeyFigure]:
    """Return the bad key figures of all runs, and the tracking lag and error of each."""
    found = []
    for one in laid:
        metrics = replace(from_json(RunMetrics, one.data.values), setpoints=(), sources=None)
        for finding in headline.of_run(one.data.run, metrics):
            if finding.kind == headline.BAD or finding.name in ("Lag", "Error after the lag"):
                found.append(replace(finding, name=f"{one.label}: {finding.name}"))
    return found


def differing(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the settings that differ between runs, with the value in each; runs: trees of plain values."""
    found: dict[str, None] = {}
    for run in runs[1:]:
        found |= dict.fromkeys(item.key for item in comparison.settings(runs[0], run))
    leaves = [comparison.leaves(run) for run in runs]
    return [{"key": key, "values": [one.get(key) for one in leaves]} for key in found]


def _figures(laid: Sequence[Laid]) -> list[Figure]:
    """Return the figures of differences, positions, torques if a run commands them, and marker tracking."""
    first, names = laid[0], laid[0].data.record.log.joint_names
    positions = [
        replace(curve, time=curve.time - first.zero)
        for curve in robot.setpoints(first.data.record.log, first.data.moves)
    ]
    torques = []
    for k, one in enumerate(laid):
        log = one.data.record.log
        positions.append(Curve(one.label, f"s{k}", one.time, log.position[:, one.columns]))
        by_torque = [log.interfaces[column] == "effort" for column in one.columns]
        torques.append(Curve(one.label, f"s{k}", one.time, np.where(by_torque, log.command[:, one.columns], np.nan)))
    pairs = [
        (f"{first.label} minus {one.label}", f"s{k}", one.compared)
        for k, one in enumerate(laid)
        if one.compared is not None
    ]
    motion = per_joint("positions", "Joint positions", "position [rad]", names, positions, min_height=0.02)
    forces = per_joint("torques", "Torques sent", "torque [N m]", names, torques, min_height=0.2)
    figures = [
        comparison_figures.differences(pairs),
        motion.about(sections.MOTION, "Positions of all joints in all runs, and their setpoints."),
        forces.about(sections.FORCES, "Torques that were sent to the joints, after the limits."),
        *_paths(laid),
    ]
    since = "the first setpoint" if first.data.moves else "the begin"
    return [replace(figure, abscissa=f"time since {since} [s]") for figure in figures]


def _paths(laid: Sequence[Laid]) -> list[Figure]:
    """Return the figure of the end effectors that follow a marker; empty unless all runs have tracking."""
    followed = [figures[0] for one in laid if (figures := marker.tracking_figures(one.data.followed))]
    if len(followed) != len(laid):
        return []
    panels = []
    for k, panel in enumerate(followed[0].panels):
        own = [figure.panels[k].curves[-1] for figure in followed]
        curves = [
            replace(curve, name=one.label, role=f"s{run}", time=curve.time - one.zero)
            for run, (one, curve) in enumerate(zip(laid, own, strict=True))
        ]
        panels.append(replace(panel, curves=tuple(curves)))
    panels[-1] = replace(panels[-1], title="distance from the marker, after the lag of each run")
    caption = "Position of the end effector in each run, and its distance from where the marker was a lag before."
    figure = replace(followed[0], title="The end effectors follow the marker", panels=tuple(panels), bands=())
    return [figure.about(sections.TRACKING, caption)]


def _events(laid: Sequence[Laid]) -> list[tuple[float, str, Event]]:
    """Return time, run and content of the events of all runs, in the order of time."""
    events = [(event.time - one.zero, one.label, event) for one in laid for event in run_page.events(one.data)]
    return sorted(events, key=lambda item: item[0])


def _robots(one: Laid, number_of_run: int, rate: float, notes: list[str]) -> list[Robot]:
    """Return the robot of a run, its human and its objects for the replay."""
    role, shift = f"s{number_of_run}", -one.zero
    robot = moving.robot(one.data, rate, notes, label=one.label, role=role, shift=shift)
    human = beside.human(one.data, rate, role=role, shift=shift)
    return [robot, *human, *beside.objects(one.data, role=role, shift=shift)]
