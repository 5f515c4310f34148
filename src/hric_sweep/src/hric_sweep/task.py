"""One run of a sweep, in a worker that keeps what it has loaded: numbers come from memory, and no bag is written."""

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
"""Robot time of the reference run [s]."""
SOURCES = ("*.py", "*.yaml", "*.xacro", "*.xml", "*.urdf", "*.msg")
"""Of the packages' files those on which a run depends."""
NOT_SOURCES = {"test", "build", "__pycache__", "sweeps"}
"""Folders without such files; what a sweep file has is in the sweep itself."""
ADDRESS = re.compile(r" at 0x[0-9a-f]+")
"""Of an object in a text of Python; each process has its own."""
REFUSED = "refused"
"""Key of the response to a run that did not begin, since its experiment cannot be."""
LENGTH = 16
"""Characters of an id."""


def run(task: dict[str, Any]) -> dict[str, Any]:
    """Carry a task out.

    Args:
        task: id, index, experiment (name, content), changes, seed, outputs, columns (whether signals are kept).

    Returns:
        id, index, outputs (name -> number, None: there is none), failure (empty, or why the run failed, as it always
        will), state_sha256, processor [s], wall [s], host; columns, a file of NumPy's, where they are kept and there
        are some; and refused, where the run did not begin.
    """
    began, wall = time.process_time(), time.perf_counter()
    response = _carried_out(task)
    gc.collect()  # a robot and its controllers point at each other, and the collector waits for many of them
    _load_is_done()
    return {
        **response,
        "processor": round(time.process_time() - began, 4),
        "wall": round(time.perf_counter() - wall, 4),
        "host": platform.node(),
    }


@cache
def _load_is_done() -> None:
    """Leave what the first run has loaded out of all later collections, which then take no time."""
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
    except Exception as error:  # also one that nobody foresaw: it ends this run alone, not the others
        failure = reason(error)
        if simulation is None and isinstance(error, HricError):
            response[REFUSED] = True
    if simulation is not None and task.get("columns"):
        response.update(_columns(simulation))
    return {**response, "failure": failure, "state_sha256": state}


def reason(error: Exception) -> str:
    """Why a run failed, for people: the same text for the same run, wherever it ran."""
    text = f"{type(error).__name__}: {error}" if isinstance(error, HricError) else describe(error)
    return ADDRESS.sub("", text)


def _plain(value: float) -> float | None:
    return None if math.isnan(value) else value


def _columns(simulation: Simulation) -> dict[str, bytes]:
    """The signals of a run, for a look at it without another run; nothing: it failed before its first cycle."""
    try:
        log = simulation.signals
    except HricError:
        return {}
    columns = {name: getattr(log, name).astype(np.float32) for name in ("position", "velocity", "effort", "command")}
    content = io.BytesIO()
    np.savez_compressed(content, joint_names=np.array(log.joint_names), time=log.time, **columns)
    return {"columns": content.getvalue()}


def definition_of(task: dict[str, Any]) -> Experiment:
    """The experiment with the values of the run.

    Raises:
        HricError: a value that cannot be.
    """
    given = task["experiment"]
    return experiment.parse(given["name"], overrides.apply(given["content"], written(task["changes"])))


def reference(task: dict[str, Any]) -> dict[str, Any]:
    """A short run by which workers are compared: code (version), state_sha256, host.

    Args:
        task: experiment, changes, seed.

    Raises:
        HricError: it cannot run.
    """
    with Simulation(definition_of(task), seed=task["seed"]) as simulation:
        simulation.run(min(REFERENCE, simulation.definition.duration))
        return {"code": code_version(), "state_sha256": simulation.state_sha256, "host": platform.node()}


def prepare() -> None:
    """Once in a worker: what goes wrong is in the response, not on the terminal."""
    logging.getLogger("hric").setLevel(logging.CRITICAL + 1)


@cache
def code_version() -> str:
    """Of everything on which a run's numbers depend: the packages' own files, and the versions of what they use."""
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
    """Id of a task: the same for the same experiment, values, seed, outputs and code."""
    about = {key: task[key] for key in ("experiment", "changes", "seed", "outputs")}
    text = json.dumps({**about, "code": code}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:LENGTH]
