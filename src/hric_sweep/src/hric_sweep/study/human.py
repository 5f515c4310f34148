"""Load on the human in the runs of a study: a table, and figures over the varied quantity. No ROS."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hric_analysis import human
from hric_bags import text as text_table
from hric_report import sections
from hric_report.figure import Curve, Figure, Panel
from hric_run.definition.parameters import HUMAN

COLUMNS = {
    "grip_force_max": ("grip force at most [N]", ".2f"),
    "grip_work": ("work on what is held [J]", ".3f"),
    "grip_work_absolute": ("to and fro [J]", ".3f"),
    "load_share": ("share of the weight that the hand carries [1]", ".3f"),
    "squeeze_max": ("squeeze or stretch at most [N]", ".2f"),
    "tilt_max": ("tilt at most [rad]", ".3f"),
    "path": ("way of the hand [m]", ".3f"),
    "strength_share_max": ("share of a joint's strength at most [1]", ".3f"),
    "activation_max": ("activation of a muscle at most [1]", ".3f"),
    "activation_mean": ("mean activation of all muscles [1]", ".4f"),
    "smoothness": ("log dimensionless jerk [1]", ".2f"),
}
"""Heading and number format of each value; a value that no run has is left out."""


def chosen(metrics: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the metrics of a run in which runs with a human differ; None without a human."""
    values = metrics.get("human")
    if not values:
        return None
    grips = [grip for grip in values["grips"].values() if grip["force_max"] is not None]
    carried = next(iter(values.get("carried", ())), None)
    muscles = values.get("muscles") or {}
    return {
        "load_share": None if carried is None else _hands_share(values["grips"], carried),
        "squeeze_max": None if carried is None else max(carried["squeeze_max"], carried["stretch_max"]),
        "tilt_max": None if carried is None else carried["tilt_max"],
        "grip_force_max": max((grip["force_max"] for grip in grips), default=None),
        "grip_work": sum(grip["work"] for grip in grips) if grips else None,
        "grip_work_absolute": sum(grip["work_absolute"] for grip in grips) if grips else None,
        "path": values["hand"]["path"],
        "strength_share_max": values["strength_share_max"],
        "activation_max": muscles.get("activation_max"),
        "activation_mean": muscles.get("activation_mean"),
        "smoothness": values["hand"]["smoothness"],
        "settling": None if values["settling"] is None else values["settling"]["verdict"],
    }


def _hands_share(grips: Mapping[str, Any], carried: Mapping[str, Any]) -> float | None:
    """Return the mean share of the weight on the human's own grips."""
    own = f"{HUMAN}::"
    shares = carried["load_share"] or {}
    found = [share["mean"] for name, share in shares.items() if grips[name]["holder"].startswith(own)]
    return sum(found) if found else None


def _columns(found: Sequence[Mapping[str, Any]]) -> dict[str, tuple[str, str]]:
    return {key: about for key, about in COLUMNS.items() if any(one.get(key) is not None for one in found)}


def lines(runs: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the table of these values, one line per run; empty without a human."""
    columns = _columns([values for run in runs.values() if (values := run.get("human"))])
    cells = [["the human, a model's estimate", *(heading for heading, _ in columns.values()), "after the motion"]]
    for name, run in runs.items():
        if values := run.get("human"):
            row = ["-" if values[key] is None else f"{values[key]:{form}}" for key, (_, form) in columns.items()]
            cells.append([name, *row, values["settling"] or "not judged"])
    return ["", *text_table.rows(cells)] if len(cells) > 1 else []


def figure(runs: Mapping[str, Mapping[str, Any]], abscissa: str) -> Figure | None:
    """Return the figure `human`: each value over the numeric names of the runs; None without human or abscissa."""
    found = sorted((float(name), run["human"]) for name, run in runs.items() if abscissa and run.get("human"))
    if not found:
        return None
    at = np.array([x for x, _ in found])
    panels = []
    for key, (heading, _) in _columns([one for _, one in found]).items():
        values = np.array([np.nan if one[key] is None else one[key] for _, one in found], dtype=float)
        name, _, unit = heading.rpartition(" [")
        panels.append(
            Panel(name, (Curve("", "measured", at, values), Curve("", "samples", at, values)), unit=f"[{unit}")
        )
    unstable = [f"{x:g}" for x, one in found if one["settling"] == human.UNSTABLE]
    caption = "Estimates of a model of the human." + f" Unstable after the motion: {', '.join(unstable)}." * bool(
        unstable
    )
    made = Figure("human", "What it requires of the human", "", tuple(panels), abscissa=abscissa)
    return made.about(sections.RESULTS, caption)
