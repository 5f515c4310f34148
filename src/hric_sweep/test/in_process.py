"""An engine of sweeps that carries runs out in this process, as they come, and sweeps that are supervised here."""

from concurrent.futures import Future
from pathlib import Path
from typing import Any

from hric_sweep import definition, table
from hric_sweep import task as runs_of_sweeps
from hric_sweep.engines.engine import Engine
from hric_sweep.journal import Journal
from hric_sweep.supervisor import Supervisor


class Here:
    """One run after the other.

    Args:
        after: runs before Ctrl-C; None: none.

    Attributes:
        begun: runs so far.
    """

    window = workers = 1

    def __init__(self, after: int | None = None) -> None:
        self.begun, self._after = 0, after

    def submit(self, task: dict[str, Any]) -> "Future[dict[str, Any]]":
        if self.begun == self._after:
            raise KeyboardInterrupt
        self.begun += 1
        future: Future[dict[str, Any]] = Future()
        future.set_result(runs_of_sweeps.run(task))
        return future

    def flush(self) -> None:
        pass

    def check(self, reference: dict[str, Any]) -> dict[str, Any]:
        raise NotImplementedError

    def close(self, *, now: bool) -> None:
        raise NotImplementedError


def carried_out(folder: Path, plan: definition.Plan, engine: Engine) -> list[table.Row]:
    """Supervise a sweep in this process; returns its rows in the order of their indices."""
    with Journal(folder) as journal:
        supervisor = Supervisor(plan, folder, journal, engine, "code")
        supervisor.run()
    return [supervisor.rows[index] for index in sorted(supervisor.rows)]
