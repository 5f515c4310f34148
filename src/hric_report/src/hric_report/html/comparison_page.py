"""Page that compares two or more runs of the same motion, aligned in time by their first setpoint."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hric_analysis import comparison
from hric_analysis.comparison import Comparison
from hric_analysis.recordings import RunEvent
from hric_analysis.values import joint_orders
from hric_report import comparison_figures, headline, sections
from hric_report.figure import Curve, Figure, FloatArray, per_joint
from hric_report.figures import marker, robot
from hric_report.html import human_and_objects, moving, run_page
from hric_report.html.page import Page, replay_rate
from hric_report.html.run_data import RunData
from hric_report.html.scene import SceneRobot


@dataclass(frozen=True)
class OverlaidRun:
    """One of the compared runs, aligned in time with the first run.

    Attributes:
        data: run data.
        label: label of the run.
        columns: for each joint of the first run, its column in the log of this run.
        zero: robot time of this run that corresponds to time 0 on the page [s].
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


def lay(runs: Sequence[RunData], labels: Sequence[str], *, fit: bool = False) -> list[OverlaidRun]:
    """Align runs in time with the first of them.

    Args:
        runs: two or more runs.
        labels: labels of the runs.
        fit: align the runs by their positions instead of their setpoints, see `comparison.overlay`.

    Raises:
        ComparisonError: joints or setpoints of a run differ from those of the first.
    """
    first, orders = runs[0], joint_orders(runs[0].run)
    zero, others = float(first.record.log.time[0]), []
    for data, label in zip(runs[1:], labels[1:], strict=True):
        compared = comparison.overlay(first.record, data.record, orders, joint_orders(data.run), fit=fit)
        zero = compared.overlays[0].start_a
        order = comparison.columns(first.record.log.joint_names, data.record.log.joint_names)
        others.append(OverlaidRun(data, label, order, compared.overlays[0].start_b, compared))
    return [OverlaidRun(first, labels[0], list(range(len(first.record.log.joint_names))), zero, None), *others]


def build(runs: Sequence[OverlaidRun], settings: Sequence[Mapping[str, object]]) -> Page:
    """Return the contents of the comparison page.

    Args:
        runs: aligned runs, starting with the first one.
        settings: settings that differ: their keys, and their values in the order of the runs.
    """
    notes = ["The separate page of each run shows its sensors, limits and parameters."]
    duration = max(float(np.ptp(run.time)) for run in runs)
    rate = replay_rate(duration, sum(moving.width(run.data) + human_and_objects.width(run.data) for run in runs))
    pairs = {run.label: comparison.difference_metrics(run.compared) for run in runs if run.compared is not None}
    return Page(
        title=" and ".join(run.label for run in runs),
        subtitle="runs of the same motion, aligned in time",
        verdicts=[("plain", f"{run.label}: {run.data.run.get('status', '')}") for run in runs],
        findings=[*headline.of_comparison(runs[0].label, pairs), *_problems(runs)],
        figures=_figures(runs),
        compared={"runs": runs, "pairs": pairs, "settings": settings, "events": _events(runs)},
        robots=[robot for k, run in enumerate(runs) if run.data.description for robot in _robots(run, k, rate, notes)],
        notes=notes,
    )


def _problems(runs: Sequence[OverlaidRun]) -> list[headline.KeyFigure]:
    """Return the key figures of all runs that report problems, and each run's tracking lag and error."""
    figures = []
    for run in runs:
        metrics = replace(run.data.run_metrics, setpoints=(), sources=None)
        figures += [
            replace(finding, name=f"{run.label}: {finding.name}")
            for finding in headline.of_run(run.data.run, metrics)
            if finding.kind == headline.BAD or finding.name in ("Lag", "Error after the lag")
        ]
    return figures


def differing(runs: Sequence[Mapping[str, object]]) -> list[dict[str, object]]:
    """Return the settings that differ between runs, with the value in each run; `runs`: their nested settings."""
    keys: dict[str, None] = {}
    for run in runs[1:]:
        keys |= dict.fromkeys(item.key for item in comparison.settings(runs[0], run))
    leaves = [comparison.leaves(run) for run in runs]
    return [{"key": key, "values": [tree.get(key) for tree in leaves]} for key in keys]


def _figures(runs: Sequence[OverlaidRun]) -> list[Figure]:
    """Return the figures of position differences, positions, torques (if commanded) and marker tracking."""
    first, names = runs[0], runs[0].data.record.log.joint_names
    positions = [
        replace(curve, time=curve.time - first.zero)
        for curve in robot.setpoints(first.data.record.log, first.data.moves)
    ]
    torques = []
    for k, run in enumerate(runs):
        log = run.data.record.log
        positions.append(Curve(run.label, f"s{k}", run.time, log.position[:, run.columns]))
        by_torque = [log.interfaces[column] == "effort" for column in run.columns]
        torques.append(Curve(run.label, f"s{k}", run.time, np.where(by_torque, log.command[:, run.columns], np.nan)))
    pairs = [
        (f"{first.label} minus {run.label}", f"s{k}", run.compared)
        for k, run in enumerate(runs)
        if run.compared is not None
    ]
    motion = per_joint("positions", "Joint positions", "position [rad]", names, positions, min_height=0.02)
    forces = per_joint("torques", "Torques sent", "torque [N m]", names, torques, min_height=0.2)
    figures = [
        comparison_figures.differences(pairs),
        motion.about(sections.MOTION, "Positions of all joints in all runs, and their setpoints."),
        forces.about(sections.FORCES, "Torques that were sent to the joints, after the limits."),
        *_paths(runs),
    ]
    since = "the first setpoint" if first.data.moves else "the beginning"
    return [replace(figure, abscissa=f"time since {since} [s]") for figure in figures]


def _paths(runs: Sequence[OverlaidRun]) -> list[Figure]:
    """Return the figure of marker tracking in all runs; empty unless the robot follows a marker in each."""
    followed = [figures[0] for run in runs if (figures := marker.tracking_figures(run.data.followed))]
    if len(followed) != len(runs):
        return []
    panels = []
    for k, panel in enumerate(followed[0].panels):
        last = [figure.panels[k].curves[-1] for figure in followed]
        curves = [
            replace(curve, name=run.label, role=f"s{number}", time=curve.time - run.zero)
            for number, (run, curve) in enumerate(zip(runs, last, strict=True))
        ]
        panels.append(replace(panel, curves=tuple(curves)))
    panels[-1] = replace(panels[-1], title="distance from the marker, after the lag of each run")
    caption = "Position of the end effector in each run, and its distance from where the marker was one lag earlier."
    figure = replace(followed[0], title="The end effectors follow the marker", panels=tuple(panels), bands=())
    return [figure.about(sections.TRACKING, caption)]


def _events(runs: Sequence[OverlaidRun]) -> list[tuple[float, str, RunEvent]]:
    """Return (time on the page [s], label of the run, event) for the events of all runs, in the order of time."""
    events = [(event.time - run.zero, run.label, event) for run in runs for event in run_page.events(run.data)]
    return sorted(events, key=lambda item: item[0])


def _robots(run: OverlaidRun, number: int, rate: float, notes: list[str]) -> list[SceneRobot]:
    """Return the robot of a run, its human and its objects, as robots of the replay."""
    role, shift = f"s{number}", -run.zero
    robot = moving.robot(run.data, rate, notes, label=run.label, role=role, shift=shift)
    human = human_and_objects.human(run.data, rate, role=role, shift=shift)
    return [robot, *human, *human_and_objects.objects(run.data, role=role, shift=shift)]
