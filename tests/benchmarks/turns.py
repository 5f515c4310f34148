"""Cases in processes of their own that take turns, so that what the machine does meanwhile meets all of them."""

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
    """The process of a case ended."""


class Worker:
    """A case in a process of its own; a context.

    Args:
        name: of the case.
        tree: the workspace whose code is timed; None: this one, in the environment as it is.
    """

    def __init__(self, name: str, tree: Path | None = None) -> None:
        self.name = name
        if tree is None:
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
        """Words of the next line that begins with one; libraries print, too."""
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
        """What a unit took in one more block [s]."""
        assert self._process.stdin is not None
        print(file=self._process.stdin, flush=True)
        return float(self._answer("time")[0])

    def __enter__(self) -> "Worker":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()  # its input ends, and with it the case
        self._errors.close()


def take_turns(workers: Sequence[Worker], rounds: int) -> list[list[float]]:
    """Times of each worker in all rounds [s]; every other round goes the other way, so that none is always first."""
    times: list[list[float]] = [[] for _ in workers]
    for number in range(rounds):
        order = range(len(workers))
        for i in order if number % 2 == 0 else reversed(order):
            times[i].append(workers[i].block())
    return times


def measure(names: Sequence[str], rounds: int = 20) -> Mapping[str, list[float]]:
    """Times of cases that take turns [s]."""
    with ExitStack() as stack:
        workers = [stack.enter_context(Worker(name)) for name in names]
        return dict(zip(names, take_turns(workers, rounds), strict=True))


def ratio(name: str, reference: str, rounds: int = 20) -> float:
    """What a case costs beside another one: median of the rounds [1]."""
    times = measure([reference, name], rounds)
    return statistics.median(one / other for one, other in zip(times[name], times[reference], strict=True))
