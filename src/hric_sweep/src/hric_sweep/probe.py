"""Check before a sweep: runs with each variable at both ends of its range, all other variables at their medians.

The sweep does not start if a variable changes no output, or if the experiment rejects its values.
Cost: two runs per variable and one common run, all with the same seed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hric_core.errors import ParameterError, message_about
from hric_core.parameters import Mistakes
from hric_run.definition.experiment import ExperimentError
from hric_sweep.definition import ROW, SweepPlan
from hric_sweep.engines.engine import Died, SweepEngine, TimedOut
from hric_sweep.records import PlainData, RunResponse
from hric_sweep.variables import Variable

ENDS = (0.01, 0.99)
"""Probabilities of the quantiles that are tested as ends of a variable's range; project default, unconfirmed (the
quantiles of 0 and 1 may be infinite)."""
MAX_REFUSED = 1
"""Maximum number of rejected values among the three tested per variable; in the sweep such values give failed runs."""


@dataclass(frozen=True)
class ProbeRun:
    """Test run: value of the tested variable, and the result of the run."""

    value: Any
    response: RunResponse

    @property
    def result(self) -> tuple[Any, ...]:
        """Outputs and reason of failure, by which test runs are compared."""
        return *self.response.outputs.items(), self.response.failure


def probe(plan: SweepPlan, engine: SweepEngine, code: str) -> list[str]:
    """Check that each variable has an effect; return warnings for the user.

    Args:
        plan: sweep to check.
        engine: engine that executes the runs.
        code: version of the code.

    Raises:
        ExperimentError: variables change no output, or have values that the experiment rejects; lists them.
    """
    middle = plan.middle()
    points = {name: ends for name, variable in plan.section.vary.items() if (ends := _ends(variable))}
    runs = [middle, *({**middle, name: value} for name, ends in points.items() for value in ends)]
    responses = iter(_responses(plan, engine, code, runs))
    central, mistakes, warnings = next(responses), Mistakes(), []
    for name, (low, high) in points.items():
        trials = [ProbeRun(low, next(responses)), ProbeRun(middle[name], central), ProbeRun(high, next(responses))]
        with mistakes.noted():
            warnings += _judged(plan, name, trials)
    try:
        mistakes.raise_all()
    except ParameterError as error:
        raise ExperimentError(message_about(f"sweep {plan.name}", error)) from error
    return warnings


def runs_of(plan: SweepPlan) -> int:
    """Return the number of runs that the check of a sweep's variables needs."""
    return 1 + 2 * sum(bool(_ends(variable)) for variable in plan.section.vary.values())


def _ends(variable: Variable) -> tuple[Any, Any] | None:
    """Return the values to test: those at both ends of a variable; None: it has one value only, or selects rows."""
    distribution = variable.distribution
    if variable.paths == (ROW,):
        return None
    values = distribution.ppf(distribution.middles if distribution.discrete else np.array(ENDS))
    last = next((value for value in reversed(values) if value != values[0]), None)
    return None if last is None else (values[0], last)


def _responses(plan: SweepPlan, engine: SweepEngine, code: str, runs: list[PlainData]) -> list[RunResponse]:
    tasks = [replace(plan.task(0, values, code), index=index) for index, values in enumerate(runs)]
    futures = [engine.submit(task) for task in tasks]
    engine.flush()
    responses = []
    for future, task in zip(futures, tasks, strict=True):
        try:
            responses.append(future.result())
        except (Died, TimedOut) as error:  # a value that kills its worker does have an effect
            responses.append(RunResponse(task.id, task.index, dict.fromkeys(task.outputs), str(error)))
    return responses


def _judged(plan: SweepPlan, name: str, trials: list[ProbeRun]) -> list[str]:
    """Return warnings about a variable. Raises ParameterError: it has no effect, or its values are rejected."""
    refused = [trial for trial in trials if trial.response.refused]
    if len(refused) > MAX_REFUSED:
        first = refused[0]
        raise ParameterError(f"sweep.vary.{name} at {_short(first.value)}: {first.response.failure}")
    if any(trial.result != trials[0].result for trial in trials):
        return []
    tried = ", ".join(_short(trial.value) for trial in trials)
    paths, outputs = ", ".join(plan.section.vary[name].paths), ", ".join(plan.section.outputs)
    text = f"sweep.vary.{name} ({paths}) changes none of the outputs {outputs} at {tried}"
    moved = {trial.response.state_sha256 for trial in trials}
    if plan.section.exceedance is not None and len(moved) > 1:  # the limit may be exceeded between the tested values
        return [f"{text}, but the motion of the arm changes"]
    raise ParameterError(f"{text}; valid: another path, an output that depends on it, or a fixed value in `changes`")


def _short(value: Any) -> str:
    return (
        f"{value:.6g}" if isinstance(value, float) else repr(value) if isinstance(value, str | Mapping) else str(value)
    )
