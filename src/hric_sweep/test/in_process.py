"""Sweeps supervised in this process, with an engine that can be interrupted."""

from concurrent.futures import Future
from pathlib import Path

from hric_sweep import definition
from hric_sweep.engines.engine import SweepEngine
from hric_sweep.engines.pebble_engine import InProcessEngine
from hric_sweep.journal import Journal
from hric_sweep.records import RunResponse, RunRow, RunTask
from hric_sweep.supervisor import SweepSupervisor


class Here(InProcessEngine):
    """Engine that executes one run after the other in this process.

    Args:
        after: number of runs before Ctrl-C; None: no Ctrl-C.

    Attributes:
        begun: number of runs started so far.
    """

    def __init__(self, after: int | None = None) -> None:
        self.begun, self._after = 0, after

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        if self.begun == self._after:
            raise KeyboardInterrupt
        self.begun += 1
        return super().submit(task)


def carried_out(folder: Path, plan: definition.SweepPlan, engine: SweepEngine) -> list[RunRow]:
    """Execute a sweep in this process; return its rows in the order of their indices."""
    with Journal(folder) as journal:
        supervisor = SweepSupervisor(plan, folder, journal, engine, "code")
        supervisor.run()
    return [supervisor.rows[index] for index in sorted(supervisor.rows)]
