"""A Dask cluster of this machine's own for tests: scheduler and workers as the manual starts them, on loopback."""

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
"""For anything here, on a machine that does much else [s]."""


def until(reached: Callable[[], bool]) -> None:
    deadline = time.monotonic() + ENOUGH
    while not reached():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def parents() -> dict[int, int]:
    """Parent of each process."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it ended meanwhile
            found[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
    return found


def below(pid: int) -> list[int]:
    """All that a process started, and what these did."""
    of = parents()
    found = [pid]
    for one in found:
        found += [child for child, parent in of.items() if parent == one]
    return found[1:]


class Cluster:
    """A scheduler and its workers.

    Args:
        folder: for what they print and write.
        sides: what stands before the commands of the scheduler, and of the workers.
        hosts: their addresses.
        certified: each shows the others a certificate, and talks to nobody without.
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
        """On a port that is free."""
        file = self._folder / "scheduler.json"
        file.unlink(missing_ok=True)
        command = f"{ROOT}/scripts/scheduler --host {self._hosts[0]} --port 0"
        self.scheduler = self._start(self._sides[0], f"{command} --scheduler-file {file}{self._tls}", {})
        until(lambda: file.exists() and file.read_text().endswith("}"))
        self.address = str(json.loads(file.read_text())["address"])

    def start_worker(self, environment: Mapping[str, str] | None = None) -> subprocess.Popen[bytes]:
        """One more."""
        scratch = self._folder / f"scratch_{self._started}"
        command = f"{ROOT}/scripts/worker {self.address} --workers 1 --local-directory {scratch}"
        command += f" --host {self._hosts[1]}{self._tls}"
        self.workers.append(self._start(self._sides[1], command, environment or {}))
        return self.workers[-1]

    def start_sleeping(self, count: int) -> None:
        """As many workers whose runs only take time, in one process."""
        self._start(self._sides[1], f"{sys.executable} {SLEEPING} {self.address} {count}", {})

    def worker_pid(self, worker: subprocess.Popen[bytes]) -> int:
        """The process that takes chunks: the nanny restarts it, and below it is that of the runs."""
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
        """By all of them."""
        return "".join(path.read_text() for path in sorted(self._folder.glob("printed_*.txt")))

    def close(self) -> None:
        """End all of them."""
        for process in reversed(self._processes):
            left = below(process.pid)
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait(ENOUGH)
            until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in left))  # noqa: B023


def started(folder: Path) -> Iterator[Cluster]:
    """One without workers yet, in a folder that is made; it ends with the test."""
    folder.mkdir()
    with closing(Cluster(folder)) as found:
        yield found
