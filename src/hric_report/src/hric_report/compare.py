"""Comparison of two recorded runs, written to a folder as metrics.json, figures and summary.txt; needs no ROS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hric_analysis import comparison, human_difference
from hric_analysis.comparison import Comparison, JointDifference, SetpointDifference, SettingDifference
from hric_analysis.human_difference import HumanDifference
from hric_analysis.values import joint_orders
from hric_assessment.typed_json import JsonObject
from hric_bags import files
from hric_bags import reader as bag_reader
from hric_bags import text as text_table
from hric_bags.reader import RunRecord
from hric_bags.records import human_record
from hric_bags.run_file import RunFile
from hric_bags.run_folder import RunFolder
from hric_core.errors import UnknownNameError
from hric_core.json_values import to_json
from hric_report import human_text

SHOWN_JOINT = 5
"""Index of the joint that has a large figure of its own: the sixth joint, as in figure 13 of the thesis."""
SHOWN_SETTINGS = ("robot", "controllers", "parameters", "human", "mocap", "duration")
"""Keys of an experiment file whose values are compared between two runs."""


@dataclass(frozen=True)
class ComparedRun:
    """One of the two runs of a comparison.

    Attributes:
        label: label of the run in text and figures.
        run: name of the run folder.
        hw: plugin type of the robot; None: not known.
        experiment, mode, status, arguments, seed, state_sha256: entries of run.yaml; None: not known.
    """

    label: str
    run: str
    hw: str | None
    experiment: str | None
    mode: str | None
    status: str | None
    arguments: Sequence[str] | None
    seed: int | None
    state_sha256: str | None


@dataclass(frozen=True)
class ComparisonMetrics:
    """Contents of metrics.json of a comparison.

    Attributes:
        runs: the two runs, by the keys "a" and "b".
        aligned_by: data by which the runs are aligned in time: "setpoints" or "positions".
        shift: time by which run B is shifted to align it with run A [s].
        setpoints: differences of the joints after each setpoint.
        human: differences of the simulated humans; None: one of the runs has none.
        settings: settings of the experiment that differ.
    """

    runs: dict[str, ComparedRun]
    aligned_by: str
    shift: float
    setpoints: list[SetpointDifference]
    human: HumanDifference | None
    settings: list[SettingDifference]


def compare(
    a: RunFolder,
    b: RunFolder,
    folder: Path,
    *,
    labels: Sequence[str] | None = None,
    joint: str | None = None,
    fit: bool = False,
    figures: bool = True,
) -> JsonObject:
    """Compare two runs and write the result to a folder, overwriting an earlier result.

    Args:
        a: first run, e.g. simulated.
        b: second run, e.g. real.
        folder: target folder; created if missing.
        labels: labels of the runs; default: the names of their folders.
        joint: name, in run A, of the joint that has a large figure; default: the sixth, or the last.
        fit: align the runs by their positions instead of the times of the setpoints (see `comparison.overlay`).
        figures: draw the figures.

    Returns:
        The metrics, with the report text under "report".

    Raises:
        HricError: a bag cannot be read, or the runs do not match.
    """
    runs = [a.read(), b.read()]
    bags = [run_folder.bag_of(run) for run_folder, run in zip((a, b), runs, strict=True)]
    records = [bag_reader.read(bag) for bag in bags]
    compared = comparison.overlay(records[0], records[1], joint_orders(runs[0]), joint_orders(runs[1]), fit=fit)
    shown = _shown(compared.joint_names, joint)
    names = (a.path.name, b.path.name) if labels is None else (labels[0], labels[1])
    labelled = {"a": _compared_run(a, runs[0], names[0]), "b": _compared_run(b, runs[1], names[1])}
    metrics = ComparisonMetrics(
        labelled,
        "positions" if fit else "setpoints",
        compared.shift,
        comparison.difference_metrics(compared),
        _people(bags, records, compared.shift),
        comparison.settings(settings_of(runs[0]), settings_of(runs[1])),
    )
    if figures:
        _draw(folder, compared, names, shown)
    return _written(folder, metrics)


def _written(folder: Path, metrics: ComparisonMetrics) -> JsonObject:
    """Write metrics.json and summary.txt; return the metrics as JSON values, with the text under "report"."""
    values, report = to_json(metrics), render(metrics)
    files.make_folder(folder)
    files.write_json(folder / "metrics.json", values)
    files.write_text(folder / "summary.txt", report)
    return {**values, "report": report}


def _draw(folder: Path, compared: Comparison, names: tuple[str, str], shown: int) -> None:
    from hric_report import comparison_figures, drawing

    pair = comparison_figures.pair_figures(compared, names, shown)
    drawing.draw(folder / drawing.FOLDER, pair, " and ".join(names))


def _people(bags: Sequence[Path], records: Sequence[RunRecord], shift: float) -> HumanDifference | None:
    """Return the differences between the simulated humans of two runs; None: one of the runs has no human."""
    a, b = (human_record.read(bag, record.robot_time) for bag, record in zip(bags, records, strict=True))
    return None if a is None or b is None else human_difference.difference(a, b, shift)


def _shown(names: Sequence[str], joint: str | None) -> int:
    if joint is None:
        return min(SHOWN_JOINT, len(names) - 1)
    if joint not in names:
        raise UnknownNameError("joint", joint, names, "the runs")
    return list(names).index(joint)


def _compared_run(folder: RunFolder, run: RunFile, label: str) -> ComparedRun:
    return ComparedRun(
        label,
        folder.path.name,
        ((run.get("definition") or {}).get("robot") or {}).get("hw"),
        run.get("experiment"),
        run.get("mode"),
        run.get("status"),
        run.get("arguments"),
        run.get("seed"),
        run.get("state_sha256"),
    )


def settings_of(run: RunFile) -> dict[str, object]:
    """Return the settings of a run's experiment that a comparison considers; `run`: contents of run.yaml."""
    definition: Mapping[str, object] = run.get("definition") or {}
    return {key: definition[key] for key in SHOWN_SETTINGS if key in definition}


def render(metrics: ComparisonMetrics) -> str:
    """Return the comparison as text, for the terminal and summary.txt."""
    lines = [f"{key.upper()}: {run.label} ({_described(run)})" for key, run in metrics.runs.items()]
    shift = f", B shifted by {1e3 * metrics.shift:+.3f} ms" if metrics.shift else ""
    lines.append(f"aligned in time by their {metrics.aligned_by}{shift}")
    parts = ["\n".join(lines), *map(_setpoint, metrics.setpoints)]
    if metrics.human:
        parts.append(human_text.difference_line(metrics.human))
    if metrics.settings:
        settings = (f"- {item.key}: {_set(item.a)}; {_set(item.b)}" for item in metrics.settings)
        parts.append("\n".join(["settings that differ (A; B):", *settings]))
    if any(item.key.endswith(".gravity") or item.key == "robot.hw" for item in metrics.settings):
        parts.append(
            "torques are comparable only if gravity and friction are compensated in the same component for both robots "
            "(thesis ch. 4.4)"
        )
    return "\n\n".join(parts) + "\n"


def _set(value: object) -> str:
    return "not set" if value is None else str(value)


def _described(run: ComparedRun) -> str:
    arguments = " ".join(run.arguments or [])
    return ", ".join(str(item) for item in (run.experiment, run.hw, run.mode, run.status, arguments) if item)


def _setpoint(setpoint: SetpointDifference) -> str:
    efforts = any(joint.effort_peak_difference is not None for joint in setpoint.joints.values())
    cells = [["joint", "peak", "at", "steady", "rms", *(["peak", "at", "steady"] if efforts else [])]]
    cells.append(["A - B", "rad", "s", "rad", "rad", *(["N m", "s", "N m"] if efforts else [])])
    cells += [[name, *_cells(joint, efforts)] for name, joint in setpoint.joints.items()]
    lines = text_table.rows(cells, head=2)
    title = (
        f"from the setpoint at {setpoint.time_a:.3f} s (A), {setpoint.time_b:.3f} s (B), {setpoint.duration:.3f} s long"
    )
    worst, steady = setpoint.peak_difference_max, setpoint.steady_difference_max
    return "\n".join([f"{title}: largest difference {worst:.2e} rad, steady {steady:.2e} rad", "", *lines])


def _cells(joint: JointDifference, efforts: bool) -> list[str]:
    row = [_small(joint.peak_difference), f"{joint.peak_time:.3f}"]
    row += [_small(joint.steady_difference), _small(joint.rms_difference)]
    torque = (joint.effort_peak_difference, joint.effort_peak_time, joint.effort_steady_difference)
    return row + ["-" if value is None else f"{value:.3f}" for value in torque] * efforts


def _small(value: float) -> str:
    return f"{value:.4f}" if abs(value) >= 1e-3 or value == 0.0 else f"{value:.1e}"
