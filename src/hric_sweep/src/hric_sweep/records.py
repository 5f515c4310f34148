"""Records of one run of a sweep: the task that an engine executes, its response, and the row of the table."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

from hric_sweep.outputs import SweepOutput

PlainData = Mapping[str, Any]
"""Content of a YAML or JSON file: mappings, lists, texts, numbers, booleans and None."""
LENGTH = 16
"""Number of characters of a run's id."""


@dataclass(frozen=True)
class RunTask:
    """Task for an engine: one run of an experiment with overrides and a seed.

    Attributes:
        index: index of the run, in the order of the sampler.
        experiment: name of the experiment, for messages and for the run folder.
        content: content of the experiment file.
        changes: values of overrides, by key.
        seed: seed of everything random in the run.
        outputs: definitions of the outputs to compute, by name.
        timeout: limit of processor time, and of wall time without progress [s].
        code: version of the code.
        until: event that ends the run, "duration" or "contact" (see `definition.ENDS`).
        runs_folder: folder in which the run gets a run folder with bag and metrics; empty: no run folder.
        signals: True if the response shall contain the signals (time series) of the run.
    """

    index: int
    experiment: str
    content: PlainData
    changes: PlainData
    seed: int
    outputs: Mapping[str, SweepOutput]
    timeout: float
    code: str
    until: str = "duration"
    runs_folder: str = ""
    signals: bool = False

    @cached_property
    def id(self) -> str:
        """Id of the run: hash of experiment, overrides, seed, end, outputs and code; equal for equal runs."""
        about = (self.experiment, self.content, self.changes, self.seed, self.until, self.code)
        outputs = {name: asdict(output) for name, output in self.outputs.items()}
        return hashlib.sha256(json.dumps([about, outputs], sort_keys=True).encode()).hexdigest()[:LENGTH]


@dataclass(frozen=True)
class RunResponse:
    """Result of a run, as an engine returns it and the journal stores it.

    Attributes:
        id, index: id and index of the task.
        outputs: values of the outputs by name; None: the run has no value.
        failure: reason why the run failed, equal whenever it is repeated; empty: it did not fail.
        state_sha256: hash of joint positions, velocities and commands; empty: the run did not reach its end.
        processor, wall: processor time and wall time [s]; None: not known.
        host: name of the machine that executed the run; empty: not known, as the worker ended.
        refused: True if the run did not start because its experiment is invalid.
        run: name of the run folder; empty: the run has none.
        attempt: number of the attempt that finished, from 1.
        signals: content of an NPZ file with the signals; None: they were not requested, or do not exist.
    """

    id: str
    index: int
    outputs: Mapping[str, float | None]
    failure: str = ""
    state_sha256: str = ""
    processor: float | None = None
    wall: float | None = None
    host: str = ""
    refused: bool = False
    run: str = ""
    attempt: int = 1
    signals: bytes | None = None


@dataclass(frozen=True)
class RunRow(RunResponse):
    """Row of a sweep's table: result of a run, its values of the variables, and its margin to the limit.

    Attributes:
        seed: seed of the run.
        batch: index of the sampler's batch that contains the run.
        weight: likelihood ratio of the point; 1 if it was drawn from the distributions.
        values: values of the variables, by name.
        margin: how far the output is beyond its limit, in the output's unit, negative on the safe side; None: unknown.
        objective: value to be maximised by a search; None: not known.
    """

    seed: int = 0
    batch: int = 0
    weight: float = 1.0
    values: PlainData = field(default_factory=dict)
    margin: float | None = None
    objective: float | None = None

    @property
    def exceeded(self) -> bool | None:
        """True if the run exceeded the limit; None: not known."""
        return None if self.margin is None else self.margin > 0.0


@dataclass(frozen=True)
class ReferenceRun:
    """Result of the reference run, by which workers are compared: code version, hash of its states, and machine."""

    code: str
    state_sha256: str
    host: str = ""
