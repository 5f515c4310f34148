"""Made-up run folders of sweeps: contacts whose peak force is a known function of the variables."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import yaml

from hric_sweep import table
from hric_sweep.definition import Sweep, SweepPlan
from hric_sweep.records import RunRow
from hric_sweep.samplers.sampler import SamplerResult
from hric_sweep.space import Space
from hric_sweep.supervisor import assessed

VARY: dict[str, Any] = {
    "speed": {
        "paths": ["human.walk.speed"],
        "unit": "m/s",
        "text": "of the hand as it meets the arm",
        "distribution": {"kind": "uniform", "low": 0.2, "high": 1.6},
    },
    "mass": {
        "paths": ["human.subject.mass"],
        "unit": "kg",
        "text": "that takes part in the blow",
        "distribution": {"kind": "normal", "mean": 4.0, "std": 1.0, "low": 1.0, "high": 8.0},
    },
    "stiffness": {
        "paths": ["human.stiffness"],
        "unit": "N/m",
        "text": "of the region that is met",
        "distribution": {"kind": "log_uniform", "low": 1e4, "high": 1.5e5},
    },
    "controller": {
        "paths": ["controller"],
        "unit": "",
        "text": "",
        "distribution": {"kind": "choice", "values": ["joint_pd", "impedance"], "weights": [0.7, 0.3]},
    },
}
OUTPUTS = {
    "peak": ("N", "largest force of the contact"),
    "duration": ("s", ""),
    "error": ("m", "of the tip at the end"),
}
LIMIT = 280.0
COST = {"processor": 0.3, "wall": 0.3, "host": "alpha", "attempt": 1}
REASONS = ("cartesian_reflex at {:.3f} s", "<b>unstable</b>: joint 3 at {:.3f} rad/s")


def plan(
    sampler: Mapping[str, Any], runs: int, vary: Mapping[str, Any] | None = None, limit: float = LIMIT
) -> SweepPlan:
    """Return the plan of a sweep with sections `sampler` and `vary` (None: VARY); `limit`: limit of the peak [N]."""
    content = {
        "description": "Peak force of a hand that meets the arm",
        "extends": "contact",
        "changes": ["simulator:=mujoco"],
        "sweep": {
            "vary": dict(vary or VARY),
            "sampler": dict(sampler),
            "runs": runs,
            "outputs": {
                name: {"path": f"impact.{name}", "unit": unit, "text": text} for name, (unit, text) in OUTPUTS.items()
            },
            "exceedance": {"output": "peak", "above": float(limit)},
            "objective": {"maximise": "peak"},
        },
    }
    sweep = Sweep.of(content, "")
    return SweepPlan(sweep, content, {"duration": 4.0}, Space(sweep.sweep.vary, ()))


def values(runs: int, seed: int = 0, failing: float = 0.02) -> dict[str, Any]:
    """Return the columns of a table; `failing`: share of the runs that fail [1]."""
    random = np.random.default_rng(seed)
    speed, mass = random.uniform(0.2, 1.6, runs), np.clip(random.normal(4.0, 1.0, runs), 1.0, 8.0)
    stiffness = np.exp(random.uniform(np.log(1e4), np.log(1.5e5), runs))
    controller = np.where(random.random(runs) < 0.7, "joint_pd", "impedance")
    mu = mass * 3.0 / (mass + 3.0)
    peak = speed * np.sqrt(mu * stiffness) * np.where(controller == "joint_pd", 1.0, 0.8)
    error = 1e-3 * np.exp(random.normal(0.0, 0.6, runs)) * (1.0 + speed)
    failed = random.random(runs) < failing
    failure = [REASONS[k % 2].format(random.uniform()) if bad else "" for k, bad in enumerate(failed)]
    outputs = {"peak": peak, "duration": np.pi * np.sqrt(mu / stiffness), "error": error}
    for column in outputs.values():
        column[failed] = np.nan
    names = [hashlib.sha256(f"{seed} {k}".encode()).hexdigest()[:16] for k in range(runs)]
    order = np.arange(runs)
    return {
        "id": names,
        "batch": order // 256,
        "weight": np.ones(runs),
        "speed": speed,
        "mass": mass,
        "stiffness": stiffness,
        "controller": controller,
        **outputs,
        "failure": failure,
        "processor": random.gamma(9.0, 0.03, runs),
        "wall": random.gamma(9.0, 0.04, runs),
        "host": np.where(random.random(runs) < 0.6, "alpha", "beta"),
        "attempt": np.where(random.random(runs) < 0.01, 2, 1),
    }


def results_sha256(rows: pyarrow.Table) -> str:
    """Hash of all columns except the cost: equal for equal results, on any machine and in any order."""
    about = json.loads(rows.schema.metadata[table.KEY])["columns"]
    kept = rows.select([name for name, column in about.items() if column["role"] != "cost"]).sort_by("index")
    return hashlib.sha256(json.dumps(kept.to_pydict(), sort_keys=True).encode()).hexdigest()


def write(
    folder: Path,
    runs: int,
    *,
    sampler: str = "random",
    planned: int | None = None,
    estimate: dict[str, Any] | None = None,
    **columns: Any,
) -> Path:
    """Write the run folder of a sweep.

    Args:
        folder: made if missing.
        runs: in the table.
        sampler: kind.
        planned: runs of the definition; None: all are there.
        estimate: of a sampler that makes its own.
        columns: replace those of `values`.
    """
    made = plan({"kind": sampler}, planned or max(runs, 1))
    found = {name: np.asarray(column).tolist() for name, column in {**values(runs), **columns}.items()}
    rows = [
        _row(made, index, dict(zip(found, one, strict=True)))
        for index, one in enumerate(zip(*found.values(), strict=True))
    ]
    return _written(folder, made, rows, estimate)


def _row(made: SweepPlan, index: int, one: dict[str, Any]) -> RunRow:
    """Return the table row of a run."""
    outputs = {name: None if np.isnan(value := one.pop(name)) else value for name in OUTPUTS}
    values = {name: one.pop(name) for name in made.section.vary}
    about = {"index": index, "seed": index + 1, "state_sha256": one["id"], **one}
    return assessed(made, RunRow(**about, values=values, outputs=outputs))


def _written(folder: Path, made: SweepPlan, rows: Sequence[RunRow], estimate: Mapping[str, Any] | None) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    table.write(folder, made, rows, estimate)
    told = {"name": folder.name, "definition": made.content, "experiment": dict(made.experiment), "code": "0.2.0"}
    (folder / "sweep.yaml").write_text(yaml.safe_dump(told))
    return folder


def sampled(
    folder: Path, made: SweepPlan, measured: Callable[[Mapping[str, Any]], Mapping[str, float]], told: int | None = None
) -> Path:
    """Write the run folder of a sweep, with its sampler executed to the end.

    Args:
        folder: made if missing.
        made: the sweep.
        measured: outputs of a run, from the values of its variables.
        told: batches after which it was cut off; None: none.
    """
    sampler, rows, estimate, batch = made.sampler(), list[RunRow](), None, 0
    while (told is None or batch < told) and (points := sampler.ask()):
        begun = len(rows)
        for point, given in zip(points, made.space.values(np.array([point.u for point in points])), strict=True):
            one = {"id": f"{len(rows):016x}", "batch": batch, "weight": point.weight, "failure": "", **COST}
            rows.append(_row(made, len(rows), {**one, **given, **measured(given)}))
        sampler.tell([SamplerResult(row.index, row.exceeded, row.objective, row.margin) for row in rows[begun:]])
        found, batch = sampler.estimate(), batch + 1
        estimate = None if found is None else asdict(found)
    return _written(folder, made, rows, estimate)
