"""Execution of tasks by an engine: repeated attempts, stored responses, and errors that are no responses."""

import signal
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import ClassVar

import pytest

from hric_sweep.engines.engine import Died, TimedOut
from hric_sweep.execution import TRIES, execute
from hric_sweep.journal import Journal
from hric_sweep.outputs import SweepOutput
from hric_sweep.records import ReferenceRun, RunResponse, RunTask

WINDOW = 3


class Scripted:
    """Engine whose tasks end at their submission.

    Args:
        of: function of a task and the number of its attempt that returns the response or an error.
    """

    window, workers = WINDOW, 1

    def __init__(self, of: Callable[[RunTask, int], RunResponse | Exception] | None = None) -> None:
        self._of, self.begun = of or (lambda task, attempt: answer(task)), list[str]()

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        self.begun.append(task.experiment)
        given = self._of(task, self.begun.count(task.experiment))
        future: Future[RunResponse] = Future()
        if isinstance(given, Exception):
            future.set_exception(given)
        else:
            future.set_result(given)
        return future

    def flush(self) -> None:
        pass

    def check(self, reference: RunTask) -> ReferenceRun:
        raise NotImplementedError

    def close(self, *, now: bool) -> None:
        raise NotImplementedError


def answer(task: RunTask) -> RunResponse:
    return RunResponse(task.id, task.index, {"x": 1.0}, host="here")


def some(*ids: str) -> list[RunTask]:
    outputs = {"x": SweepOutput(path="stability.x")}
    return [RunTask(index, name, {}, {}, 0, outputs, 1.0, "code") for index, name in enumerate(ids)]


def test_a_task_that_dies_or_takes_too_long_is_tried_again_and_the_attempt_is_told(tmp_path: Path) -> None:
    def of(task: RunTask, attempt: int) -> RunResponse | Exception:
        first = {1: Died("ended its worker"), 2: TimedOut("took longer than 1 s")} if task.experiment == "b" else {}
        return first.get(attempt) or answer(task)

    engine, told = Scripted(of), list[RunResponse]()
    with Journal(tmp_path) as journal:
        found = execute(some("a", "b", "c"), engine, journal, told.append)
        kept = {entry.id: entry for entry in journal.entries}
    assert [one.attempt for one in found] == [1, 3, 1] and [one.failure for one in found] == ["", "", ""]
    assert kept[found[1].id].attempt == 3 and len(told) == len(kept) == 3


@pytest.mark.parametrize("why", [Died("ended its worker (exit code 7)"), TimedOut("took longer than 1 s")])
def test_a_task_that_always_dies_is_marked_after_its_tries_and_its_neighbours_are_not(
    tmp_path: Path, why: Exception
) -> None:
    engine = Scripted(lambda task, attempt: why if task.experiment == "b" else answer(task))
    with Journal(tmp_path) as journal:
        found = execute(some("a", "b", "c"), engine, journal)
    assert engine.begun.count("b") == TRIES == 3
    assert [one.failure for one in found] == ["", f"failed in each of 3 attempts: {why}", ""]
    assert found[1].outputs == {"x": None} and found[1].attempt == 3


def test_an_engine_that_cannot_go_on_ends_it_and_what_ended_by_then_is_kept(tmp_path: Path) -> None:
    class Gone(Exception):
        pass

    engine = Scripted(lambda task, attempt: Gone() if task.experiment == "b" else answer(task))
    with Journal(tmp_path) as journal:
        with pytest.raises(Gone):
            execute(some("b", "a"), engine, journal)
        assert [entry.index for entry in journal.entries] == [1]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_while_the_journal_is_written_comes_when_all_in_it_is_told(
    tmp_path: Path, number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Journal, "_append", Journal.append, raising=False)
    monkeypatch.setattr(Journal, "append", lambda self, lines: (self._append(lines), signal.raise_signal(number)))
    before, told = signal.signal(signal.SIGTERM, signal.default_int_handler), list[RunResponse]()
    try:
        with Journal(tmp_path) as journal:
            with pytest.raises(KeyboardInterrupt):
                execute(some("a", "b"), Scripted(), journal, told.append)
            assert [entry.index for entry in told] == [entry.index for entry in journal.entries] == [0, 1]
    finally:
        signal.signal(signal.SIGTERM, before)


def test_what_the_journal_has_is_not_run_again_and_a_point_chosen_twice_keeps_its_two_places(tmp_path: Path) -> None:
    tasks = some("a", "b", "a")
    with Journal(tmp_path) as journal:
        first = execute(tasks, Scripted(), journal)
    engine, told = Scripted(), list[RunResponse]()
    with Journal(tmp_path) as journal:
        again = execute(tasks, engine, journal, told.append)
    assert engine.begun == [] and again == first == told
    assert [one.index for one in again] == [0, 1, 2]


def test_no_more_tasks_are_open_than_the_engine_wants() -> None:
    class Slow(Scripted):
        """Engine that ends its tasks when it has enough of them, or the last one."""

        open_: ClassVar[list[tuple[Future[RunResponse], RunTask]]] = []

        def submit(self, task: RunTask) -> "Future[RunResponse]":
            future: Future[RunResponse] = Future()
            self.open_.append((future, task))
            assert len(self.open_) <= WINDOW
            if len(self.open_) == WINDOW or task.experiment == "g":
                for one, about in self.open_:
                    one.set_result(answer(about))
                self.open_.clear()
            return future

    assert len(execute(some(*"abcdefg"), Slow(), None)) == 7


def test_tasks_that_an_engine_keeps_back_go_when_no_further_one_comes() -> None:
    class Chunks(Scripted):
        """Engine that ends its tasks only at `flush`."""

        kept: ClassVar[list[tuple[Future[RunResponse], RunTask]]] = []

        def submit(self, task: RunTask) -> "Future[RunResponse]":
            self.kept.append((Future(), task))
            return self.kept[-1][0]

        def flush(self) -> None:
            for future, task in self.kept:
                future.set_result(answer(task))
            self.kept.clear()

    assert [one.index for one in execute(some("a", "b"), Chunks(), None)] == [0, 1]
