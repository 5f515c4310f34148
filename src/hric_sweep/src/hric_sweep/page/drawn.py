"""Data that the browser draws: columns of all runs, or of a seeded sample of them, as typed arrays."""

from typing import Any

import numpy as np
import numpy.typing as npt

from hric_core.geometry import FloatArray
from hric_report.html.scene import Blob
from hric_sweep.page.lists import WORST
from hric_sweep.page.sample import Sample
from hric_sweep.page.sensitivity import Ranks
from hric_sweep.page.study import VARIABLE, RecordedSweep

VALUES = 2_600_000
"""Maximum number of values in all columns together, so that a page stays below 20 MB: as single precision in base64
these values take 14 MB. Project default, unconfirmed."""
SEED = 0
AXES, PAIRS = 12, 8
"""Maximum number of columns that are visible at first, and in the scatter matrix. Project default, unconfirmed."""
DECADES = 2.5
"""Range of an output [decades] above which its axis is logarithmic; all its values must be positive."""


def chosen(study: RecordedSweep) -> npt.NDArray[np.intp]:
    """Return the table rows (runs) to draw, in ascending order: all, or a seeded sample and the worst ones."""
    # Besides its values, each run takes a kind, an index, a weight, and 17 letters of its id: about 7 values.
    drawn = VALUES // (len(study.variables) + len(study.outputs) + 7)
    if study.runs <= drawn:
        return np.arange(study.runs)
    sample = np.random.default_rng(SEED).choice(study.runs, drawn, replace=False)
    return np.unique(np.concatenate([sample, study.order_of_worst[0][:WORST]]))


def caption(study: RecordedSweep, rows: npt.NDArray[np.intp]) -> str:
    """Return a sentence that says how many of the runs are drawn."""
    if len(rows) == study.runs:
        return f"All {study.runs} runs are drawn."
    return f"Drawn: a random sample of {len(rows)} of {study.runs} runs (seed {SEED}), including the worst {WORST}."


def counts(sample: Sample, rows: npt.NDArray[np.intp], blob: Blob) -> Any:
    """Return the weight of each drawn run in a distribution, for the page's scripts; None: all have weight 1."""
    return blob.add(sample.counts[rows], "f4") if np.any(sample.counts[rows] != 1.0) else None


def columns(study: RecordedSweep, rows: npt.NDArray[np.intp], rank: Ranks, blob: Blob) -> list[dict[str, object]]:
    """Return the table's columns for the page's scripts; `rank`: rank correlations between columns, by name."""
    names = study.variables + study.outputs
    # The output with the limit is always visible initially.
    order = sorted(names, key=lambda name: study.limit is None or study.limit.output != name)
    on = [name for name in order if not study.constant(name)][:AXES]
    return [_column(study, name, rows, rank.get(name, {}), name in on, blob) for name in names]


def _column(
    study: RecordedSweep,
    name: str,
    rows: npt.NDArray[np.intp],
    rank: dict[str, tuple[float, float]],
    on: bool,
    blob: Blob,
) -> dict[str, object]:
    values, labels = study.numbers(name)
    about, limit = study.about[name], study.limit
    return {
        "name": name,
        "role": about.role,
        "unit": about.unit,
        "text": about.text,
        "labels": labels,
        "log": not labels and _logarithmic(study, name, values),
        "limit": limit.bound if limit is not None and limit.output == name else None,
        "rank": {other: value for other, (value, _) in rank.items()},
        "on": on,
        "values": blob.add(values[rows], "f4"),
    }


def _logarithmic(study: RecordedSweep, name: str, values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    if not len(known) or known.min() <= 0.0:
        return False
    if study.about[name].role == VARIABLE:
        variable = (study.section.get("vary") or {}).get(name) or {}
        return (variable.get("distribution") or {}).get("kind") in ("log_uniform", "log_normal")
    return bool(np.log10(known.max() / known.min()) > DECADES)
