"""Execution of one run of a sweep in a worker that is reused: outputs are computed in memory, no bag is written."""

import gc
import hashlib
import io
import json
import logging
import math
import platform
import re
import time
from functools import cache
from typing import Any

import numpy as np

from hric_bags.run_folder import RunFolderError
from hric_control.manager.loop import describe
from hric_core.errors import HricError
from hric_run import provenance
from hric_run.definition import experiment, overrides
from hric_run.definition.experiment import Experiment, package_path
from hric_run.simulation import Simulation
from hric_sweep.definition import written
from hric_sweep.observed import Observed
from hric_sweep.outputs import Output

REFERENCE = 0.1
"""Duration of the reference run, in robot time [s]."""
SOURCES = ("*.py", "*.yaml", "*.xacro", "*.xml", "*.urdf", "*.msg")
"""Patterns of the files in the packages on which a run depends."""
NOT_SOURCES = {"test", "build", "__pycache__", "sweeps"}
"""Folders without such files; the content of a sweep file is stored in the sweep itself."""
ADDRESS = re.compile(r" at 0x[0-9a-f]+")
"""Memory address of an object in a text of Python; it differs between processes."""
REFUSED = "refused"
"""Response key that marks a run which did not start because its experiment is invalid."""
LENGTH = 16
"""Number of characters of an id."""


def run(task: dict[str, Any]) -> dict[str, Any]:
    """Execute a task.

    Args:
        task: id, index, experiment (name, content), changes, seed, outputs, columns (True: return the signals).

    Returns:
        id, index, outputs (name -> number, None: no value), failure (empty, or the reason, which is the same at each
        repetition), state_sha256, processor [s], wall [s], host; columns, the content of an NPZ file, if signals are
        requested and exist; and refused, if the run did not start.
    """
    began, wall = time.process_time(), time.perf_counter()
    response = _carried_out(task)
    gc.collect()  # robot and controllers reference each other, and automatic collection would come late
    _load_is_done()
    return {
        **response,
        "processor": round(time.process_time() - began, 4),
        "wall": round(time.perf_counter() - wall, 4),
        "host": platform.node(),
    }


@cache
def _load_is_done() -> None:
    """Exclude objects that the first run has loaded from later garbage collections, which then take no time."""
    gc.freeze()


def _carried_out(task: dict[str, Any]) -> dict[str, Any]:
    outputs = {name: Output.of(given, f"outputs.{name}") for name, given in task["outputs"].items()}
    response: dict[str, Any] = {"id": task["id"], "index": task["index"], "outputs": {name: None for name in outputs}}
    failure, state = "", ""
    simulation: Simulation | None = None
    try:
        with Simulation(definition_of(task), seed=task["seed"]) as simulation:
            observed = Observed(simulation, {one.group for one in outputs.values()})
            simulation.run()
            values = observed.values()
            state = values.log.state_sha256()
            response["outputs"] = {name: _plain(one.measured(values)) for name, one in outputs.items()}
    except MemoryError:
        failure = "MemoryError: the run took more memory than a worker may"
    except Exception as error:  # also unexpected errors: they end this run, not the sweep
        failure = reason(error)
        if simulation is None and isinstance(error, HricError):
            response[REFUSED] = True
    if simulation is not None and task.get("columns"):
        response.update(_columns(simulation))
    return {**response, "failure": failure, "state_sha256": state}


def reason(error: Exception) -> str:
    """Return why a run failed, as text: the same text for the same run on any machine."""
    text = f"{type(error).__name__}: {error}" if isinstance(error, HricError) else describe(error)
    return ADDRESS.sub("", text)


def _plain(value: float) -> float | None:
    return None if math.isnan(value) else value


def _columns(simulation: Simulation) -> dict[str, bytes]:
    """Return the signals of a run as an NPZ file; empty: the run failed before its first cycle."""
    try:
        log = simulation.signals
    except HricError:
        return {}
    columns = {name: getattr(log, name).astype(np.float32) for name in ("position", "velocity", "effort", "command")}
    content = io.BytesIO()
    np.savez_compressed(content, joint_names=np.array(log.joint_names), time=log.time, **columns)
    return {"columns": content.getvalue()}


def definition_of(task: dict[str, Any]) -> Experiment:
    """Return the experiment with the values of the run.

    Raises:
        HricError: a value is invalid.
    """
    given = task["experiment"]
    return experiment.parse(given["name"], overrides.apply(given["content"], written(task["changes"])))


def reference(task: dict[str, Any]) -> dict[str, Any]:
    """Execute a short run that serves to compare workers, and return code (version), state_sha256 and host.

    Args:
        task: experiment, changes, seed.

    Raises:
        HricError: the run fails.
    """
    with Simulation(definition_of(task), seed=task["seed"]) as simulation:
        simulation.run(min(REFERENCE, simulation.definition.duration))
        return {"code": code_version(), "state_sha256": simulation.state_sha256, "host": platform.node()}


def prepare() -> None:
    """Silence the log of a worker process: errors are in the response, not on the terminal."""
    logging.getLogger("hric").setLevel(logging.CRITICAL + 1)


@cache
def code_version() -> str:
    """Return the hash of everything on which results depend: files of the packages, versions of dependencies."""
    digest = hashlib.sha256(json.dumps(_used_versions(), sort_keys=True).encode())
    for name in provenance.HRIC_PACKAGES:
        try:
            folder = package_path(name)
        except (HricError, RunFolderError):
            continue
        for path in sorted(path for pattern in SOURCES for path in folder.rglob(pattern)):
            part = path.relative_to(folder)
            if not NOT_SOURCES & set(part.parts):
                digest.update(f"{name}/{part}".encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _used_versions() -> dict[str, str]:
    found = provenance.versions()
    return {name: found[name] for name in ("python", *provenance.DISTRIBUTIONS) if name in found}


def identity(task: dict[str, Any], code: str) -> str:
    """Return the id of a task: equal for equal experiment, values, seed, outputs and code."""
    about = {key: task[key] for key in ("experiment", "changes", "seed", "outputs")}
    text = json.dumps({**about, "code": code}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:LENGTH]
