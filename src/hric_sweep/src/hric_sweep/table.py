"""Table of a sweep: a Parquet file with units and one row per finished run."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.parquet

from hric_bags import files
from hric_bags.run_folder import runs_root
from hric_core.errors import HricError
from hric_sweep.definition import SweepPlan
from hric_sweep.journal import JournalError
from hric_sweep.records import PlainData, RunRow

NAME, KEY = "runs.parquet", b"hric"
RUN = {
    "id": "id of the run, for `sweep rerun`",
    "index": "index of the run in sampling order",
    "batch": "index of the sampler's batch that contains the run",
    "seed": "seed of the run",
    "weight": "likelihood ratio of importance sampling; 1: not weighted",
}
RESULT = {
    "exceeded": "true if the output exceeded its limit",
    "objective": "value of the objective",
    "failure": "reason of failure; empty: the run did not fail",
    "state_sha256": "hash of joint positions, velocities and commands",
}
COST = {
    "processor": "processor time",
    "wall": "wall time",
    "host": "name of the machine that executed the run",
    "attempt": "number of the attempt that finished",
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


def columns(plan: SweepPlan) -> dict[str, dict[str, str]]:
    """Return role, unit and description of each column of the table, by name in order."""
    section = plan.section
    about = {name: {"role": "run", "unit": "", "text": text} for name, text in RUN.items()}
    about |= {name: {"role": "variable", "unit": v.unit, "text": v.text} for name, v in section.vary.items()}
    about |= {name: {"role": "output", "unit": v.unit, "text": v.text} for name, v in section.outputs.items()}
    about |= {name: {"role": "run", "unit": "", "text": text} for name, text in RESULT.items()}
    if section.objective is not None:
        about["objective"]["unit"] = section.outputs[section.objective.output].unit
    return about | {name: {"role": "cost", "unit": UNITS.get(name, ""), "text": text} for name, text in COST.items()}


def write(folder: Path, plan: SweepPlan, rows: Sequence[RunRow], estimate: PlainData | None) -> Path:
    """Write the table of a sweep, replacing an existing one.

    Args:
        folder: run folder of the sweep.
        plan: sweep to which the rows belong.
        rows: rows in order of index.
        estimate: estimate of the sampler; None: there is none.

    Raises:
        JournalError: the table cannot be written; the previous one remains.
    """
    about = columns(plan)
    arrays = {name: _array(name, column["role"], rows) for name, column in about.items()}
    meta = {"columns": about, "sweep": plan.content, "estimate": estimate}
    made = pyarrow.table(arrays).replace_schema_metadata({KEY: json.dumps(meta).encode()})
    path = folder / NAME
    try:
        with files.atomic(path) as temporary:
            pyarrow.parquet.write_table(made, temporary)
    except files.FileError as error:
        raise JournalError(f"{error}; all finished runs are in the journal in the same folder") from error
    return path


def _array(name: str, role: str, rows: Sequence[RunRow]) -> pyarrow.Array:
    if role == "variable":
        values = [row.values[name] for row in rows]
        if all(isinstance(value, bool | int | float | str) for value in values) and len({type(v) for v in values}) < 2:
            return pyarrow.array(values)
        if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
            return pyarrow.array(values, pyarrow.float64())
        return pyarrow.array([value if isinstance(value, str) else json.dumps(value) for value in values])
    values = [row.outputs[name] if role == "output" else getattr(row, name) for row in rows]
    if role == "output" or name == "objective":
        values = [math.nan if value is None else value for value in values]
    return pyarrow.array(values, pyarrow.float64() if role == "output" else _TYPES.get(name, pyarrow.string()))


def find(folder: str | Path) -> Path:
    """Return the run folder of a sweep, given by its path or by its name in the folder of all runs.

    Raises:
        HricError: there is no such sweep.
    """
    for candidate in (Path(folder).expanduser(), runs_root() / folder):
        if (candidate / "sweep.yaml").is_file():
            return candidate.resolve()
    raise HricError(
        f"no sweep {str(folder)!r} (a folder with sweep.yaml), neither in the current folder nor in {runs_root()}"
    )


def read(folder: str | Path) -> pyarrow.Table:
    """Return the table of a sweep. Raises HricError: there is no such sweep, or it has no table yet."""
    path = find(folder) / NAME
    if not path.is_file():
        raise HricError(f"{path.parent} has no {NAME} yet; valid: hric sweep --resume {path.parent}")
    return pyarrow.parquet.read_table(path)


def load_sweep(folder: str | Path) -> Any:
    """Return the table of a sweep as a pandas data frame with one row per run.

        runs = load_sweep("peak_force_20261125-120000")
        runs.attrs["columns"]["peak"]     # {"role": "output", "unit": "N", "text": ...}

    Args:
        folder: path of the sweep's run folder, or its name in the folder of all runs.

    Returns:
        pandas.DataFrame; attrs: columns, sweep and estimate.

    Raises:
        HricError: there is no such sweep.
    """
    table = read(folder)
    frame = table.to_pandas()
    frame.attrs = json.loads(table.schema.metadata[KEY])
    return frame
