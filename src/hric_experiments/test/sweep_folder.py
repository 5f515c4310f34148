"""Folders of made-up sweeps, as a sweep leaves them: a contact whose peak force follows from what is varied."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import yaml
from pyarrow import parquet

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
REASONS = ("cartesian_reflex at {:.3f} s", "<b>unstable</b>: joint 3 at {:.3f} rad/s")
SMALL_COST = ("processor", "wall", "host", "attempt")


def definition(sampler: str, runs: int) -> dict[str, Any]:
    """Of the sweep, canonical."""
    return {
        "description": "Peak force of a hand that meets the arm",
        "extends": "contact",
        "changes": ["simulator:=mujoco"],
        "sweep": {
            "vary": VARY,
            "correlation": [],
            "sampler": {"kind": sampler},
            "runs": runs,
            "seeds": "each",
            "seed": 0,
            "outputs": {name: {"path": name, "unit": unit, "text": text} for name, (unit, text) in OUTPUTS.items()},
            "exceedance": {"output": "peak", "above": LIMIT},
            "objective": {"maximise": "peak"},
            "timeout": 60.0,
            "keep": {"worst": 10, "failed": True},
        },
    }


def values(runs: int, seed: int = 0, failing: float = 0.02) -> dict[str, Any]:
    """Columns of a table; failing: share of the runs that fail."""
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
    exceeded = [None if bad else bool(value > LIMIT) for bad, value in zip(failed, peak, strict=True)]
    names = [hashlib.sha256(f"{seed} {k}".encode()).hexdigest()[:16] for k in range(runs)]
    order = np.arange(runs)
    return {
        "id": names,
        "index": order,
        "batch": order // 256,
        "seed": order + 1,
        "weight": np.ones(runs),
        "speed": speed,
        "mass": mass,
        "stiffness": stiffness,
        "controller": controller,
        **outputs,
        "exceeded": pyarrow.array(exceeded, pyarrow.bool_()),
        "objective": peak,
        "failure": failure,
        "state_sha256": names,
        "processor": random.gamma(9.0, 0.03, runs),
        "wall": random.gamma(9.0, 0.04, runs),
        "host": np.where(random.random(runs) < 0.6, "alpha", "beta"),
        "attempt": np.where(random.random(runs) < 0.01, 2, 1),
    }


def write(
    folder: Path,
    runs: int,
    *,
    sampler: str = "random",
    planned: int | None = None,
    estimate: dict[str, Any] | None = None,
    **columns: Any,
) -> Path:
    """Write a folder.

    Args:
        folder: made if missing.
        runs: in the table.
        sampler: kind.
        planned: runs of the definition; None: all are there.
        estimate: of a sampler that makes its own.
        columns: replace those of `values`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table = pyarrow.table({**values(runs), **columns})
    about = {name: {"role": "run", "unit": "", "text": ""} for name in table.column_names}
    about |= {name: {"role": "variable", "unit": one["unit"], "text": one["text"]} for name, one in VARY.items()}
    about |= {name: {"role": "output", "unit": unit, "text": text} for name, (unit, text) in OUTPUTS.items()}
    about |= {name: {"role": "cost", "unit": "", "text": ""} for name in SMALL_COST}
    told = {"columns": about, "sweep": definition(sampler, planned or runs), "estimate": estimate}
    parquet.write_table(table.replace_schema_metadata({b"hric": json.dumps(told).encode()}), folder / "runs.parquet")
    made = {"name": folder.name, "definition": told["sweep"], "experiment": {"duration": 4.0}, "code": "0.2.0"}
    (folder / "sweep.yaml").write_text(yaml.safe_dump(made))
    return folder
