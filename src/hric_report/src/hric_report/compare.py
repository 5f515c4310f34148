"""Comparison of two run folders, written to a folder as metrics.json, figures and summary.txt; needs no ROS."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hric_analysis import comparison, human_difference
from hric_analysis.comparison import Comparison
from hric_analysis.values import joint_orders
from hric_bags import files
from hric_bags import reader as bag_reader
from hric_bags import text as text_table
from hric_bags.reader import RunRecord
from hric_bags.records import human_record
from hric_bags.run_folder import RunFolder
from hric_core.errors import UnknownNameError
from hric_report.run import bag_of

SHOWN_JOINT = 5
"""Column of the joint that is shown large: the sixth, as in figure 13 of the thesis."""
SHOWN_SETTINGS = ("robot", "controllers", "parameters", "human", "mocap", "duration")
"""Keys of an experiment whose values are compared between two runs."""


def compare(
    a: RunFolder,
    b: RunFolder,
    folder: Path,
    *,
    labels: Sequence[str] | None = None,
    joint: str | None = None,
    fit: bool = False,
    figures: bool = True,
) -> dict[str, Any]:
    """Compare two runs and write the result, overwriting an earlier one.

    Args:
        a: first run, e.g. simulated.
        b: second run, e.g. real.
        folder: target folder; created if missing.
        labels: labels of the runs; default: the names of their folders.
        joint: name, in run A, of the joint shown large; default: the sixth, or the last.
        fit: align the runs by their positions instead of the times of the setpoints (see `comparison.overlay`).
        figures: draw the figures.

    Returns:
        The metrics, with the report text under "report".

    Raises:
        HricError: a bag cannot be used, or the runs do not match.
    """
    runs = [a.read(), b.read()]
    bags = [bag_of(run_folder, run) for run_folder, run in zip((a, b), runs, strict=True)]
    records = [bag_reader.read(bag) for bag in bags]
    compared = comparison.overlay(records[0], records[1], joint_orders(runs[0]), joint_orders(runs[1]), fit=fit)
    shown = _shown(compared.joint_names, joint)
    names = (a.path.name, b.path.name) if labels is None else (labels[0], labels[1])
    result = {
        "runs": {"a": _head(a, runs[0], names[0]), "b": _head(b, runs[1], names[1])},
        "aligned_by": "positions" if fit else "setpoints",
        "shift": compared.shift,
        "setpoints": comparison.difference_metrics(compared),
        "human": _people(bags, records, compared.shift),
        "settings": comparison.settings(settings_of(runs[0]), settings_of(runs[1])),
    }
    _write(folder, result, report := render(result))
    if figures:
        _draw(folder, compared, names, shown)
    return {**result, "report": report}


def _draw(folder: Path, compared: Comparison, names: tuple[str, str], shown: int) -> None:
    from hric_report import comparison_figures, drawing

    pair = comparison_figures.pair_figures(compared, names, shown)
    drawing.draw(folder / drawing.FOLDER, pair, " and ".join(names))


def _people(bags: Sequence[Path], records: Sequence[RunRecord], shift: float) -> dict[str, Any] | None:
    """Return the differences between the simulated humans of two runs; None: one of the runs has no human."""
    a, b = (human_record.read(bag, record.robot_time) for bag, record in zip(bags, records, strict=True))
    return None if a is None or b is None else human_difference.difference(a, b, shift)


def _write(folder: Path, result: Mapping[str, Any], report: str) -> None:
    files.make_folder(folder)
    files.write_json(folder / "metrics.json", result)
    files.write_text(folder / "summary.txt", report)


def _shown(names: Sequence[str], joint: str | None) -> int:
    if joint is None:
        return min(SHOWN_JOINT, len(names) - 1)
    if joint not in names:
        raise UnknownNameError("joint", joint, names, "the runs")
    return list(names).index(joint)


def _head(folder: RunFolder, run: Mapping[str, Any], label: str) -> dict[str, Any]:
    kept = {key: run.get(key) for key in ("experiment", "mode", "status", "arguments", "seed", "state_sha256")}
    return {
        "label": label,
        "run": folder.path.name,
        "hw": ((run.get("definition") or {}).get("robot") or {}).get("hw"),
        **kept,
    }


def settings_of(run: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a run's experiment that are compared; `run` is the contents of run.yaml."""
    definition = run.get("definition") or {}
    return {key: definition[key] for key in SHOWN_SETTINGS if key in definition}


def render(result: Mapping[str, Any]) -> str:
    """Return the comparison as text, for the terminal and summary.txt; `result` is the contents of metrics.json."""
    a, b = (result["runs"][key] for key in "ab")
    lines = [f"{key.upper()}: {run['label']} ({_labelled(run)})" for key, run in zip("ab", (a, b), strict=True)]
    lines.append(
        f"overlaid on each other by their {result['aligned_by']}"
        + (f", B shifted by {1e3 * result['shift']:+.3f} ms" if result["shift"] else "")
    )
    parts = ["\n".join(lines), *(_move(move) for move in result["setpoints"])]
    if result["human"]:
        parts.append(human_difference.line(result["human"]))
    if result["settings"]:
        settings = (f"- {item['key']}: {_set(item['a'])}; {_set(item['b'])}" for item in result["settings"])
        parts.append("\n".join(["set differently (A; B):", *settings]))
    if any(item["key"].endswith(".gravity") or item["key"] == "robot.hw" for item in result["settings"]):
        parts.append(
            "torques compare only if both robots compensate gravity and friction at the same place (thesis ch. 4.4)"
        )
    return "\n\n".join(parts) + "\n"


def _set(value: Any) -> str:
    return "not set" if value is None else str(value)


def _labelled(run: Mapping[str, Any]) -> str:
    arguments = " ".join(run["arguments"] or [])
    return ", ".join(
        str(item) for item in (run["experiment"], run["hw"], run["mode"], run["status"], arguments) if item
    )


def _move(move: Mapping[str, Any]) -> str:
    efforts = any("effort_peak_difference" in joint for joint in move["joints"].values())
    cells = [["joint", "peak", "at", "steady", "rms", *(["peak", "at", "steady"] if efforts else [])]]
    cells.append(["A - B", "rad", "s", "rad", "rad", *(["N m", "s", "N m"] if efforts else [])])
    for name, joint in move["joints"].items():
        row = [
            name,
            _small(joint["peak_difference"]),
            f"{joint['peak_time']:.3f}",
            _small(joint["steady_difference"]),
            _small(joint["rms_difference"]),
        ]
        if efforts:
            row += [_effort(joint, key) for key in ("peak_difference", "peak_time", "steady_difference")]
        cells.append(row)
    lines = text_table.rows(cells)
    lines[1], lines[2] = lines[2], lines[1]
    title = (
        f"from the setpoint at {move['time_a']:.3f} s (A), {move['time_b']:.3f} s (B), {move['duration']:.3f} s long"
    )
    worst = f"largest difference {move['peak_difference_max']:.2e} rad, steady {move['steady_difference_max']:.2e} rad"
    return "\n".join([f"{title}: {worst}", "", *lines])


def _small(value: float) -> str:
    return f"{value:.4f}" if abs(value) >= 1e-3 or value == 0.0 else f"{value:.1e}"


def _effort(joint: Mapping[str, float], key: str) -> str:
    return f"{joint[f'effort_{key}']:.3f}" if f"effort_{key}" in joint else "-"
