"""Execution of one run of a sweep in a worker process: outputs are computed in memory, without writing a bag."""

import gc
import hashlib
import io
import json
import logging
import math
import platform
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from hric_bags.run_folder import RunFolderError
from hric_control.manager.loop import describe
from hric_core.errors import HricError
from hric_run import provenance
from hric_run.definition import experiment, overrides
from hric_run.definition.experiment import Experiment, package_path
from hric_run.simulation import Simulation
from hric_sweep.approaches.contact_events import run_until_contact_ends
from hric_sweep.definition import ENDS, written
from hric_sweep.observed import Observed
from hric_sweep.records import PlainData, ReferenceRun, RunResponse, RunTask

REFERENCE = 0.1
"""Duration of the reference run, in robot time [s]."""
SOURCES = ("*.py", "*.yaml", "*.xacro", "*.xml", "*.urdf", "*.msg")
"""Patterns of the files in packages on which the result of a run depends."""
NOT_SOURCES = {"test", "build", "__pycache__", "sweeps"}
"""Folders of packages on which results do not depend; the content of a sweep file is stored in the sweep itself."""
ADDRESS = re.compile(r" at 0x[0-9a-f]+")
"""Memory address of an object in Python's error texts, which differs between processes."""
RUNNING: Mapping[str, Callable[[Simulation], None]] = dict(
    zip(ENDS, (Simulation.run, run_until_contact_ends), strict=True)
)
"""Function that runs a simulation to its end, by the event that ends it ("duration", "contact")."""


def run(task: RunTask) -> RunResponse:
    """Execute the run of a task and return its result."""
    began, wall = time.process_time(), time.perf_counter()
    response = _executed(task)
    gc.collect()  # robot and controllers reference each other, and automatic collection would come late
    _load_is_done()
    return replace(
        response,
        processor=round(time.process_time() - began, 4),
        wall=round(time.perf_counter() - wall, 4),
        host=platform.node(),
    )


@cache
def _load_is_done() -> None:
    """Exclude the objects that the first run has loaded from later garbage collections, which are then fast."""
    gc.freeze()


def _executed(task: RunTask) -> RunResponse:
    outputs: dict[str, float | None] = dict.fromkeys(task.outputs)
    failure, state, run_folder, refused = "", "", "", False
    simulation: Simulation | None = None
    values: PlainData
    try:
        if task.runs_folder:
            run_folder, values = _recorded(task)
            state = values["state_sha256"]
        else:
            with Simulation(definition_of(task), seed=task.seed) as simulation:
                observed = Observed(simulation, {output.group for output in task.outputs.values()})
                RUNNING[task.until](simulation)
                values = observed.values()
                state = values.log.state_sha256()
        outputs = {name: _plain(output.measured(values)) for name, output in task.outputs.items()}
    except MemoryError:
        failure = "MemoryError: the run needs more memory than the limit of a worker"
    except Exception as error:  # also unexpected errors: they end this run, not the sweep
        failure, refused = reason(error), simulation is None and isinstance(error, HricError)
    signals = _signals(simulation) if task.signals and simulation is not None else None
    return RunResponse(task.id, task.index, outputs, failure, state, refused=refused, run=run_folder, signals=signals)


def _recorded(task: RunTask) -> tuple[str, PlainData]:
    """Execute a task with a run folder; return the folder's name and the metrics. Raises KeyboardInterrupt: Ctrl-C."""
    from hric_report import headless  # imported here: slow to load, and most sweeps record nothing

    root, changes = Path(task.runs_folder), written(task.changes)
    result = headless.run(definition_of(task), changes, seed=task.seed, root=root, progress=False, figures=False)
    if result.interrupted:
        raise KeyboardInterrupt
    return result.folder.path.name, result.metrics


def reason(error: Exception) -> str:
    """Return the reason why a run failed; the text is equal on all machines."""
    text = f"{type(error).__name__}: {error}" if isinstance(error, HricError) else describe(error)
    return ADDRESS.sub("", text)


def _plain(value: float) -> float | None:
    return None if math.isnan(value) else value


def _signals(simulation: Simulation) -> bytes | None:
    """Return the signals of a run as an NPZ file; None: the run failed before its first cycle."""
    try:
        log = simulation.signals
    except HricError:
        return None
    columns = {name: getattr(log, name).astype(np.float32) for name in ("position", "velocity", "effort", "command")}
    content = io.BytesIO()
    np.savez_compressed(content, joint_names=np.array(log.joint_names), time=log.time, **columns)
    return content.getvalue()


def definition_of(task: RunTask) -> Experiment:
    """Return the experiment of a task, with its overrides applied.

    Raises:
        HricError: an override is invalid.
    """
    return experiment.parse(task.experiment, overrides.apply(task.content, written(task.changes)))


def reference(task: RunTask) -> ReferenceRun:
    """Execute the reference run, a short run whose result must be equal on all workers.

    Raises:
        HricError: the run fails.
    """
    with Simulation(definition_of(task), seed=task.seed) as simulation:
        simulation.run(min(REFERENCE, simulation.definition.duration))
        return ReferenceRun(code_version(), simulation.state_sha256, platform.node())


def prepare() -> None:
    """Suppress log messages in a worker process: errors are part of the run's result instead."""
    logging.getLogger("hric").setLevel(logging.CRITICAL + 1)


@cache
def code_version() -> str:
    """Return the hash of everything on which results depend: files of all packages, versions of dependencies."""
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
    versions = provenance.versions()
    return {name: versions[name] for name in ("python", *provenance.DISTRIBUTIONS) if name in versions}
