"""Supervisor of a sweep: passes points of the sampler to an engine as tasks, stores responses and returns results."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags import files
from hric_sweep import table
from hric_sweep.carrying import carry_out
from hric_sweep.definition import Plan
from hric_sweep.engines.engine import Engine, Task
from hric_sweep.journal import Journal
from hric_sweep.samplers.sampler import Point, Told
from hric_sweep.task import identity

REFRESH = 20.0
"""Interval between two writes of the table while the sweep runs [s of wall time]."""
COLUMNS = "columns"


class Supervisor:
    """Execution of one sweep in its run folder.

    Args:
        plan: sweep to run.
        folder: run folder of the sweep.
        journal: journal in the same folder; runs with a stored response are not run again.
        engine: engine that executes the runs.
        code: version of the code.
        ended: callback for each finished row, including rows restored from the journal.
        wrote: callback after each write of the table, with the folder.

    Attributes:
        rows: rows of finished runs, by index.
        estimate: estimate of the sampler as plain data; None: there is none.
    """

    def __init__(
        self,
        plan: Plan,
        folder: Path,
        journal: Journal,
        engine: Engine,
        code: str,
        ended: Callable[[table.Row], object] = lambda row: None,
        wrote: Callable[[Path], object] = lambda folder: None,
    ) -> None:
        self._plan, self._folder, self._journal, self._engine, self._code = plan, folder, journal, engine, code
        self._ended, self._wrote, self._written = ended, wrote, time.monotonic()
        self.rows: dict[int, table.Row] = {}
        self.estimate: dict[str, Any] | None = None

    def run(self) -> None:
        """Run until the sampler has no more points.

        Raises:
            JournalError: finished runs cannot be stored.
            KeyboardInterrupt: Ctrl-C; all finished runs are stored and in the table.
        """
        sampler, batch = self._plan.sampler(), 0
        try:
            while points := sampler.ask():
                rows = self._carry_out(self._tasks(points, batch))
                sampler.tell([self._told(row) for row in rows])
                found, batch = sampler.estimate(), batch + 1
                self.estimate = None if found is None else asdict(found)
            self.write()  # before the repeated runs, which a second signal may cut short
            self._keep_columns()
        finally:
            self.write()

    def write(self) -> None:
        """Write the table of the finished runs."""
        table.write(self._folder, self._plan, [self.rows[index] for index in sorted(self.rows)], self.estimate)
        self._written = time.monotonic()
        self._wrote(self._folder)

    # -- tasks ---------------------------------------------------------------------------------------------------------

    def _tasks(self, points: Sequence[Point], batch: int) -> list[tuple[Task, table.Row]]:
        plan, first = self._plan, len(self.rows)
        found = []
        for offset, (point, values) in enumerate(
            zip(points, plan.space.values(np.array([point.u for point in points])), strict=True)
        ):
            task = make_task(plan, first + offset, values, self._code)
            row = {key: task[key] for key in ("id", "index", "seed")}
            found.append((task, {**row, "batch": batch, "weight": point.weight, "values": values}))
        return found

    def _carry_out(self, tasks: Sequence[tuple[Task, table.Row]]) -> list[table.Row]:
        """Execute a batch of tasks and return its rows in order."""
        begun = {row["index"]: row for _, row in tasks}
        carry_out(
            [task for task, _ in tasks],
            self._engine,
            self._journal,
            lambda entry: self._end(begun[entry["index"]], entry),
            self._refresh,
        )
        return [self.rows[index] for index in begun]

    def _refresh(self) -> None:
        if time.monotonic() - self._written > REFRESH:
            self.write()

    def _end(self, row: table.Row, entry: Mapping[str, Any]) -> None:
        ended = {**row, **entry, **judged(self._plan, entry["outputs"])}
        self.rows[row["index"]] = ended
        self._ended(ended)

    def _told(self, row: table.Row) -> Told:
        section = self._plan.section
        sign = 1.0 if section.objective is None else section.objective.sign
        objective = None if row["objective"] is None else sign * row["objective"]
        return Told(row["index"], row["exceeded"], objective, row["margin"])

    # -- what is kept --------------------------------------------------------------------------------------------------

    def _keep_columns(self) -> None:
        """Repeat the worst and the failed runs and store their signals."""
        folder = self._folder / COLUMNS
        chosen: list[Task] = []
        for row in kept(self._plan, list(self.rows.values())):
            if not (folder / f"{row['id']}.npz").exists():
                task = make_task(self._plan, row["index"], row["values"], self._code)
                chosen.append({**task, "columns": True})
        carry_out(chosen, self._engine, None, lambda entry: _write_columns(entry, folder))


def _write_columns(entry: Mapping[str, Any], folder: Path) -> None:
    """Write the signals of a run to a file, if its response has any."""
    if "columns" in entry:
        folder.mkdir(exist_ok=True)
        with files.atomic(folder / f"{entry['id']}.npz") as temporary:
            temporary.write_bytes(entry["columns"])


def make_task(plan: Plan, index: int, values: Mapping[str, Any], code: str) -> Task:
    """Return the task of a run.

    Args:
        plan: sweep of the run.
        index: index of the run.
        values: values of the variables.
        code: version of the code.
    """
    section = plan.section
    task: Task = {
        "index": index,
        "experiment": {"name": plan.name, "content": plan.experiment},
        "changes": plan.changes(values),
        "seed": plan.seed(index),
        "outputs": plan.content["sweep"]["outputs"],
        "timeout": section.timeout,
    }
    return {"id": identity(task, code), **task}


def judged(plan: Plan, outputs: Mapping[str, float | None]) -> dict[str, Any]:
    """Return exceeded, margin and objective of a run; None if they are not known."""
    section = plan.section
    exceedance, objective = section.exceedance, section.objective
    value = None if exceedance is None else outputs.get(exceedance.output)
    margin = None if exceedance is None or value is None else exceedance.margin(value)
    return {
        "exceeded": None if margin is None else margin > 0.0,
        "margin": margin,
        "objective": None if objective is None else outputs.get(objective.output),
    }


def kept(plan: Plan, rows: Sequence[table.Row]) -> list[table.Row]:
    """Return the rows whose signals are stored: the worst runs, and failed runs that ended with a response."""
    keep = plan.section.keep
    worst = [row for row in rows if not row["failure"] and badness(plan, row) > -math.inf]
    worst = sorted(worst, key=lambda row: (-badness(plan, row), row["index"]))[: keep.worst]
    failed = [row for row in rows if row["failure"] and row["host"]] if keep.failed else []
    return worst + sorted(failed, key=lambda row: int(row["index"]))[: keep.worst]


def badness(plan: Plan, row: table.Row) -> float:
    """Return the sort key for the worst runs, which is largest for the worst one."""
    objective = plan.section.objective
    if objective is not None:
        return -math.inf if row["objective"] is None else objective.sign * float(row["objective"])
    if plan.section.exceedance is not None:
        return -math.inf if row["margin"] is None else float(row["margin"])
    first = next(iter(row["outputs"].values()))
    return -math.inf if first is None else float(first)
