"""Benchmark cases in separate processes that alternate, so that other load of the machine affects all of them."""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from hric_core.errors import FailureError

FOLDER = Path(__file__).resolve().parent


class WorkerError(FailureError):
    """Error of a case whose process ended."""


class Worker:
    """Case in a separate process, as a context manager.

    Args:
        name: name of the case.
        tree: workspace whose code is measured; None: this one, in the present environment.
        command, env: another program with the protocol of worker.py, and its environment variables.
    """

    def __init__(
        self,
        name: str,
        tree: Path | None = None,
        command: Sequence[str] | None = None,
        env: Mapping[str, str] | None = None,
    ) -> None:
        self.name = name
        if command is not None:
            environment = dict(os.environ if env is None else env)
        elif tree is None:
            command, environment = [sys.executable, str(FOLDER / "worker.py"), name], dict(os.environ)
        else:
            script = '. "$0/scripts/env" && exec python3 "$0/tests/benchmarks/worker.py" "$1"'
            command = ["bash", "-c", script, str(tree), name]
            environment = {key: os.environ[key] for key in ("HOME", "PATH", "LANG", "USER") if key in os.environ}
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  (closed with the process)
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, text=True, env=environment
        )
        self._answer("ready")

    def _answer(self, word: str) -> list[str]:
        """Return the words of the next line that begins with a word; other lines, printed by libraries, are skipped."""
        assert self._process.stdout is not None
        for line in self._process.stdout:
            first, *others = line.split() or [""]
            if first == word:
                return others
        code = self._process.wait()
        self._errors.seek(0)
        told = self._errors.read().strip().splitlines()
        raise WorkerError(f"{self.name} ended with code {code}: {told[-1] if told else 'no word'}")

    def block(self) -> float:
        """Return the time of a unit in another block [s]."""
        assert self._process.stdin is not None
        print(file=self._process.stdin, flush=True)
        return float(self._answer("time")[0])

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()  # closing its input ends the case
        self._errors.close()


def take_turns(workers: Sequence[Worker], rounds: int) -> list[list[float]]:
    """Return the times of each worker in all rounds [s]; the order is reversed in every second round."""
    times: list[list[float]] = [[] for _ in workers]
    for number in range(rounds):
        order = range(len(workers))
        for i in order if number % 2 == 0 else reversed(order):
            times[i].append(workers[i].block())
    return times


def measure(names: Sequence[str], rounds: int = 20) -> Mapping[str, list[float]]:
    """Return the times of alternating cases by name [s]."""
    with ExitStack() as stack:
        workers = [stack.enter_context(Worker(name)) for name in names]
        return dict(zip(names, take_turns(workers, rounds), strict=True))


def ratio(name: str, reference: str, rounds: int = 20) -> float:
    """Return the cost of a case as a ratio to another one, median of the rounds [1]."""
    times = measure([reference, name], rounds)
    return statistics.median(one / other for one, other in zip(times[name], times[reference], strict=True))
