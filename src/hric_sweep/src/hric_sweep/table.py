"""The table of a sweep: a row for each run that ended, with units, readable by any tool that reads Parquet."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.parquet

from hric_bags import files
from hric_bags.run_folder import runs_root
from hric_core.errors import HricError
from hric_sweep.definition import Plan
from hric_sweep.journal import JournalError

NAME, KEY = "runs.parquet", b"hric"
Row = dict[str, Any]
"""id, index, batch, seed, weight, values, outputs, exceeded, margin, objective, failure, state_sha256, and the cost."""
RUN = {
    "id": "of the run, for `sweep rerun`",
    "index": "in order of the sampler",
    "batch": "in which the sampler asked for it",
    "seed": "of everything random in the run",
    "weight": "likelihood ratio of an importance sample; 1: none",
}
RESULT = {
    "exceeded": "whether it passed the limit of the exceedance",
    "objective": "that a search goes for",
    "failure": "why it failed; empty: it did not",
    "state_sha256": "of the bits of position, velocity and command",
}
COST = {
    "processor": "time of a processor",
    "wall": "time that passed",
    "host": "name of the machine",
    "attempt": "in which it ended",
}
UNITS = {"processor": "s", "wall": "s"}
_TYPES = {
    "index": pyarrow.int64(),
    "batch": pyarrow.int64(),
    "seed": pyarrow.int64(),
    "weight": pyarrow.float64(),
    "exceeded": pyarrow.bool_(),
    "objective": pyarrow.float64(),
    "processor": pyarrow.float64(),
    "wall": pyarrow.float64(),
    "attempt": pyarrow.int64(),
}


def columns(plan: Plan) -> dict[str, dict[str, str]]:
    """Of each column its role, unit and text, in their order."""
    section = plan.section
    about = {name: {"role": "run", "unit": "", "text": text} for name, text in RUN.items()}
    about |= {name: {"role": "variable", "unit": v.unit, "text": v.text} for name, v in section.vary.items()}
    about |= {name: {"role": "output", "unit": v.unit, "text": v.text} for name, v in section.outputs.items()}
    about |= {name: {"role": "run", "unit": "", "text": text} for name, text in RESULT.items()}
    if section.objective is not None:
        about["objective"]["unit"] = section.outputs[section.objective.output].unit
    return about | {name: {"role": "cost", "unit": UNITS.get(name, ""), "text": text} for name, text in COST.items()}


def write(folder: Path, plan: Plan, rows: Sequence[Row], estimate: Mapping[str, Any] | None) -> Path:
    """Replace the table.

    Args:
        folder: of the sweep.
        plan: the sweep.
        rows: in order of index.
        estimate: of a sampler of rare events.

    Raises:
        JournalError: it cannot be written; the one of before stays.
    """
    about = columns(plan)
    arrays = {name: _array(name, one["role"], plan, rows) for name, one in about.items()}
    meta = {"columns": about, "sweep": plan.content, "estimate": estimate}
    made = pyarrow.table(arrays).replace_schema_metadata({KEY: json.dumps(meta).encode()})
    path = folder / NAME
    try:
        with files.atomic(path) as temporary:
            pyarrow.parquet.write_table(made, temporary)
    except files.FileError as error:
        raise JournalError(
            f"{error}; all runs that ended are in the journal beside it; make space, then: hric sweep --resume {folder}"
        ) from error
    return path


def _array(name: str, role: str, plan: Plan, rows: Sequence[Row]) -> pyarrow.Array:
    if role == "variable":
        values = [row["values"][name] for row in rows]
        if all(isinstance(value, bool | int | float | str) for value in values) and len({type(v) for v in values}) < 2:
            return pyarrow.array(values)
        if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
            return pyarrow.array(values, pyarrow.float64())
        return pyarrow.array([value if isinstance(value, str) else json.dumps(value) for value in values])
    if role == "output":
        numbers = [row["outputs"][name] for row in rows]
        return pyarrow.array([float("nan") if value is None else value for value in numbers], pyarrow.float64())
    values = [row[name] for row in rows]
    if name == "objective":
        values = [float("nan") if value is None else value for value in values]
    return pyarrow.array(values, _TYPES.get(name, pyarrow.string()))


def results_sha256(table: pyarrow.Table) -> str:
    """Hash of all columns but the cost: equal for equal results, whoever computed them, and in whatever order."""
    about = json.loads(table.schema.metadata[KEY])["columns"]
    kept = table.select([name for name, one in about.items() if one["role"] != "cost"]).sort_by("index")
    return hashlib.sha256(json.dumps(kept.to_pydict(), sort_keys=True).encode()).hexdigest()


def find(folder: str | Path) -> Path:
    """Folder of a sweep, by its path or by its name in the folder of all runs.

    Raises:
        HricError: there is none.
    """
    for candidate in (Path(folder).expanduser(), runs_root() / folder):
        if (candidate / "sweep.yaml").is_file():
            return candidate.resolve()
    raise HricError(f"no sweep {str(folder)!r} (a folder with sweep.yaml), neither here nor in {runs_root()}")


def read(folder: str | Path) -> pyarrow.Table:
    """The table of a sweep. Raises HricError: there is none."""
    path = find(folder) / NAME
    if not path.is_file():
        raise HricError(f"{path.parent} has no {NAME} yet; valid: hric sweep --resume {path.parent}")
    return pyarrow.parquet.read_table(path)


def load_sweep(folder: str | Path) -> Any:
    """The table of a sweep as a pandas frame, a row for each run.

        runs = load_sweep("peak_force_20261125-120000")
        runs.attrs["columns"]["peak"]     # {"role": "output", "unit": "N", "text": ...}

    Args:
        folder: its path, or its name in the folder of all runs.

    Returns:
        pandas.DataFrame; attrs: columns, sweep and estimate.

    Raises:
        HricError: no such sweep.
    """
    table = read(folder)
    frame = table.to_pandas()
    frame.attrs = json.loads(table.schema.metadata[KEY])
    return frame
