"""Control of a sweep: turns the sampler's points into runs, has an engine execute them, and stores the results."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from hric_bags import files
from hric_sweep import table
from hric_sweep.definition import SweepPlan
from hric_sweep.engines.engine import SweepEngine
from hric_sweep.execution import execute
from hric_sweep.journal import Journal
from hric_sweep.records import PlainData, RunResponse, RunRow
from hric_sweep.samplers.sampler import Point, SamplerResult

REFRESH = 20.0
"""Wall time between two writes of the table while the sweep runs [s]."""
COLUMNS = "columns"


class SweepSupervisor:
    """Controller of one sweep: executes it in its run folder.

    Args:
        plan: sweep to run.
        folder: run folder of the sweep.
        journal: journal in the same folder; runs whose response it contains are not run again.
        engine: engine that executes the runs.
        code: version of the code.
        on_row: callback for each finished run, including runs restored from the journal.
        on_table: callback after each write of the table; its argument is the run folder.

    Attributes:
        rows: table rows of the finished runs, by index.
        estimate: exceedance probability estimated by the sampler, as plain data; None: there is no estimate.
    """

    def __init__(
        self,
        plan: SweepPlan,
        folder: Path,
        journal: Journal,
        engine: SweepEngine,
        code: str,
        on_row: Callable[[RunRow], object] = lambda row: None,
        on_table: Callable[[Path], object] = lambda folder: None,
    ) -> None:
        self._plan, self._folder, self._journal, self._engine, self._code = plan, folder, journal, engine, code
        self._on_row, self._on_table, self._written = on_row, on_table, time.monotonic()
        self.rows: dict[int, RunRow] = {}
        self.estimate: PlainData | None = None

    def run(self) -> None:
        """Execute the sweep until the sampler has no more points.

        Raises:
            JournalError: finished runs cannot be stored.
            KeyboardInterrupt: Ctrl-C; all finished runs are stored and in the table.
        """
        sampler, batch = self._plan.sampler(), 0
        try:
            while points := sampler.ask():
                sampler.tell([self._result(row) for row in self._run_batch(points, batch)])
                estimate, batch = sampler.estimate(), batch + 1
                self.estimate = None if estimate is None else asdict(estimate)
            self.write()  # before the repeated runs, which a second signal may cut short
            self._keep_signals()
        finally:
            self.write()

    def write(self) -> None:
        """Write the table of the finished runs."""
        table.write(self._folder, self._plan, [self.rows[index] for index in sorted(self.rows)], self.estimate)
        self._written = time.monotonic()
        self._on_table(self._folder)

    def _run_batch(self, points: Sequence[Point], batch: int) -> list[RunRow]:
        """Execute the runs of a batch of points; return their table rows in order."""
        plan, first = self._plan, len(self.rows)
        values = plan.space.values(np.array([point.u for point in points]))
        tasks = [plan.task(first + offset, row, self._code) for offset, row in enumerate(values)]

        def on_response(response: RunResponse) -> None:
            offset = response.index - first
            row = RunRow(**vars(response), seed=tasks[offset].seed, batch=batch)
            self._end(replace(row, weight=points[offset].weight, values=values[offset]))

        execute(tasks, self._engine, self._journal, on_response, self._refresh)
        return [self.rows[task.index] for task in tasks]

    def _end(self, row: RunRow) -> None:
        self.rows[row.index] = assessed(self._plan, row)
        self._on_row(self.rows[row.index])

    def _refresh(self) -> None:
        if time.monotonic() - self._written > REFRESH:
            self.write()

    def _result(self, row: RunRow) -> SamplerResult:
        objective = self._plan.section.objective
        value = None if objective is None or row.objective is None else objective.sign * row.objective
        return SamplerResult(row.index, row.exceeded, value, row.margin)

    def _keep_signals(self) -> None:
        """Repeat the worst and the failed runs, to store their signals (time series)."""
        folder = self._folder / COLUMNS
        tasks = [
            replace(self._plan.task(row.index, row.values, self._code), signals=True)
            for row in rows_with_signals(self._plan, list(self.rows.values()))
            if not (folder / f"{row.id}.npz").exists()
        ]
        execute(tasks, self._engine, None, lambda response: _write_signals(response, folder))


def _write_signals(response: RunResponse, folder: Path) -> None:
    """Write the signals of a run to a file, if its response has any."""
    if response.signals is not None:
        folder.mkdir(exist_ok=True)
        with files.atomic(folder / f"{response.id}.npz") as temporary:
            temporary.write_bytes(response.signals)


def assessed(plan: SweepPlan, row: RunRow) -> RunRow:
    """Return a copy of a row with margin to the limit and objective; each is None if not known."""
    exceedance, objective = plan.section.exceedance, plan.section.objective
    value = None if exceedance is None else row.outputs.get(exceedance.output)
    return replace(
        row,
        margin=None if exceedance is None or value is None else exceedance.margin(value),
        objective=None if objective is None else row.outputs.get(objective.output),
    )


def rows_with_signals(plan: SweepPlan, rows: Sequence[RunRow]) -> list[RunRow]:
    """Return the runs whose signals are stored: the worst runs, and failed runs that did not end their worker."""
    keep = plan.section.keep
    worst = [row for row in rows if not row.failure and badness(plan, row) > -math.inf]
    worst = sorted(worst, key=lambda row: (-badness(plan, row), row.index))[: keep.worst]
    failed = [row for row in rows if row.failure and row.host] if keep.failed else []
    return worst + sorted(failed, key=lambda row: row.index)[: keep.worst]


def badness(plan: SweepPlan, row: RunRow) -> float:
    """Return the criterion of the worst run, largest for the worst: objective, else margin, else the first output."""
    objective, value = plan.section.objective, next(iter(row.outputs.values()))
    if objective is not None:
        value = None if row.objective is None else objective.sign * row.objective
    elif plan.section.exceedance is not None:
        value = row.margin
    return -math.inf if value is None else value
