"""Dask cluster on this machine's loopback interface for tests: scheduler and workers, started as in the manual."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
SLEEPING = Path(__file__).with_name("sleeping_workers.py")
ENOUGH = 580.0
"""Timeout of all waits in the tests, long enough for a busy machine [s]."""


def until(reached: Callable[[], bool]) -> None:
    deadline = time.monotonic() + ENOUGH
    while not reached():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def parents() -> dict[int, int]:
    """Return the parent of each process, by process id."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it ended meanwhile
            found[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
    return found


def below(pid: int) -> list[int]:
    """Return all descendants of a process."""
    of = parents()
    found = [pid]
    for one in found:
        found += [child for child, parent in of.items() if parent == one]
    return found[1:]


class Cluster:
    """Dask scheduler with its workers.

    Args:
        folder: folder for output and files of the processes.
        sides: prefixes of the commands of scheduler and workers.
        hosts: addresses of scheduler and workers.
        certified: True if all processes require certificates of each other.
    """

    def __init__(
        self,
        folder: Path,
        sides: tuple[Sequence[str], Sequence[str]] = ((), ()),
        hosts: tuple[str, str] = ("127.0.0.1", "127.0.0.1"),
        *,
        certified: bool = False,
    ) -> None:
        self._folder, self._sides, self._hosts, self._started = folder, sides, hosts, 0
        self._tls = "" if hosts == ("127.0.0.1", "127.0.0.1") else " --insecure"
        if certified:
            self.certificate, self.key = folder / "certificate.pem", folder / "key.pem"
            made = f"openssl req -x509 -newkey rsa:2048 -nodes -days 1 -subj /CN=hric -keyout {self.key}"
            subprocess.run([*made.split(), "-out", self.certificate], check=True, capture_output=True)
            self._tls = f" --tls-ca-file {self.certificate} --tls-cert {self.certificate} --tls-key {self.key}"
        self._processes: list[subprocess.Popen[bytes]] = []
        self.workers: list[subprocess.Popen[bytes]] = []
        self.start_scheduler()

    def start_scheduler(self) -> None:
        """Start the scheduler on a free port."""
        file = self._folder / "scheduler.json"
        file.unlink(missing_ok=True)
        command = f"{ROOT}/scripts/scheduler --host {self._hosts[0]} --port 0"
        self.scheduler = self._start(self._sides[0], f"{command} --scheduler-file {file}{self._tls}", {})
        until(lambda: file.exists() and file.read_text().endswith("}"))
        self.address = str(json.loads(file.read_text())["address"])

    def start_worker(self, environment: Mapping[str, str] | None = None) -> subprocess.Popen[bytes]:
        """Start one more worker."""
        scratch = self._folder / f"scratch_{self._started}"
        command = f"{ROOT}/scripts/worker {self.address} --workers 1 --local-directory {scratch}"
        command += f" --host {self._hosts[1]}{self._tls}"
        self.workers.append(self._start(self._sides[1], command, environment or {}))
        return self.workers[-1]

    def start_sleeping(self, count: int) -> None:
        """Start many workers in one process, whose runs only sleep."""
        self._start(self._sides[1], f"{sys.executable} {SLEEPING} {self.address} {count}", {})

    def worker_pid(self, worker: subprocess.Popen[bytes]) -> int:
        """Return the process id of the worker that executes chunks; its nanny restarts it, its child executes runs."""
        of = parents()
        candidates = [pid for pid in below(worker.pid) if of[pid] == worker.pid]
        return max(candidates, key=lambda pid: len(below(pid)))

    def _start(self, before: Sequence[str], command: str, environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
        self._started += 1
        with (self._folder / f"printed_{self._started}.txt").open("wb") as file:
            process = subprocess.Popen(
                [*before, *command.split()],
                stdout=file,
                stderr=file,
                env={**os.environ, **environment},
                start_new_session=True,
            )
        self._processes.append(process)
        return process

    def printed(self) -> str:
        """Return the output of all processes."""
        return "".join(path.read_text() for path in sorted(self._folder.glob("printed_*.txt")))

    def close(self) -> None:
        """End all processes."""
        for process in reversed(self._processes):
            left = below(process.pid)
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait(ENOUGH)
            until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in left))  # noqa: B023


def started(folder: Path) -> Iterator[Cluster]:
    """Yield a cluster without workers, in a new folder; it ends with the test."""
    folder.mkdir()
    with closing(Cluster(folder)) as found:
        yield found
