"""Measure what the window in the browser costs: its processor, its traffic, and the missed deadlines of the loop.

    python tests/benchmarks/window_cost.py [--seconds 40] [--rounds 3]

Arm and person (experiment shared_workspace in MuJoCo) run through scripts/bringup at real time. In each round the
viewers are 0, 1, 10 and 0 clients that read and do not draw, so that the missed deadlines of the loop with viewers can
be compared with those without in the same run. The table has the mean of the rounds: the verdict so far, the longest
work of the window, falls into some of them and not into others.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import yaml

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in ("tests/integration", "scripts/lib", "src/hric_core/test")]

from live_cost import processor_time  # noqa: E402
from live_system import LiveSystem  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402
from websockets.sync.client import connect  # noqa: E402
from websockets.typing import Origin  # noqa: E402

DEFINITION = ROOT / "src/hric_experiments/config/experiments/shared_workspace.yaml"
CLIENTS = (0, 1, 10, 0)
SETTLING = 1.0
"""Time between the connection of the clients and their measurement [s]: a first verdict is part of what is measured."""


class Client:
    """Viewer that reads and does not draw; `frames` and `size` [bytes] count what came after the scene."""

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        origin = Origin(f"http://{parts.netloc}")
        self._open = ExitStack()
        address = f"ws://{parts.netloc}/socket?{parts.query}"
        self._socket = self._open.enter_context(connect(address, origin=origin, max_size=None))
        self.scene = len(self._socket.recv(60))
        self.frames = self.size = 0
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        try:
            for text in self._socket:
                self.frames, self.size = self.frames + 1, self.size + len(text)
        except ConnectionClosed:
            pass

    def close(self) -> None:
        """Disconnect."""
        self._open.close()
        self._thread.join()


def window_pid(system: LiveSystem) -> int:
    """Return the process of the window's node."""
    return next(pid for pid, line in system.processes().items() if "__name:=window" in line)


def missed(diagnostics: list[object]) -> float:
    """Return the number of missed deadlines that the loop has reported so far."""
    counts = [
        float(item.value)  # type: ignore[attr-defined]
        for message in diagnostics
        for status in message.status  # type: ignore[attr-defined]
        for item in status.values
        if item.key == "missed deadlines"
    ]
    return counts[-1] if counts else float("nan")


def measured(system: LiveSystem, address: str, count: int, seconds: float, heard: list[object]) -> dict[str, float]:
    """Return the figures of a number of clients."""
    with ExitStack() as stack:
        clients = [Client(address) for _ in range(count)]
        for client in clients:
            stack.callback(client.close)
        time.sleep(SETTLING)
        pid, begin = window_pid(system), time.monotonic()
        used, before, lost = processor_time(pid), [(c.frames, c.size) for c in clients], missed(heard)
        time.sleep(seconds)
        span = time.monotonic() - begin
        figures = {
            "processor of the window [%]": 100.0 * (processor_time(pid) - used) / span,
            "missed deadlines of the loop [1/s]": (missed(heard) - lost) / span,
        }
        if clients:
            rates = [((c.frames - f) / span, (c.size - s) / span) for c, (f, s) in zip(clients, before, strict=True)]
            figures["frames [Hz]"] = statistics.mean(rate for rate, _ in rates)
            figures["traffic of a client [kB/s]"] = statistics.mean(size for _, size in rates) / 1e3
            figures["scene [kB]"] = clients[0].scene / 1e3
        return figures


def main() -> None:
    """Run the bring-up and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=40.0, help="duration of each measurement [s]")
    parser.add_argument("--rounds", type=int, default=3, help="number of rounds")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        content = yaml.safe_load(DEFINITION.read_text())
        content["duration"] = 60.0 + given.rounds * len(CLIENTS) * (given.seconds + SETTLING + 2.0)
        path = Path(folder) / "experiment.yaml"
        path.write_text(yaml.safe_dump(content))
        words = ("env:=sim", "rviz:=false", "view:=web", "simulator:=mujoco", f"experiment:={path}", "record:=false")
        system = LiveSystem(Path(folder), *words)
        os.nice(19)  # viewers have machines of their own; here they only get what the system leaves
        try:
            report(system, given.seconds, given.rounds)
        finally:
            system.interrupt()
            system.close()


def report(system: LiveSystem, seconds: float, rounds: int) -> None:
    """Measure the rounds and print the table."""
    system.wait_output("  ready ", 120.0)
    address = next(word for word in system.output.split() if word.startswith("http://127.0.0.1") and "token=" in word)
    print(f"first output to window open: processor of its node {processor_time(window_pid(system)):.2f} s")
    os.environ["ROS_MASTER_URI"] = system.uri
    import rospy
    from diagnostic_msgs.msg import DiagnosticArray

    rospy.init_node("window_cost", disable_signals=True)
    heard: list[object] = []
    rospy.Subscriber("/diagnostics", DiagnosticArray, heard.append)
    found: list[list[dict[str, float]]] = [[] for _ in CLIENTS]
    for _ in range(rounds):
        for figures, count in zip(found, CLIENTS, strict=True):
            figures.append(measured(system, address, count, seconds, heard))
    for figures, count in zip(found, CLIENTS, strict=True):
        means = {name: round(statistics.mean(one[name] for one in figures), 2) for name in figures[0]}
        print(f"{count:2d} clients: {json.dumps(means)}")


if __name__ == "__main__":
    main()
