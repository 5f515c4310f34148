"""How fast a torque callback of an unmodified libfranka runs against the emulated arm, beside a server whose robot is a
constant state.

    python tests/benchmarks/fci_rate.py [panda|fr3] [word of the control_box command ...]

Both servers run unpaced in lock-step, as processes of their own, and so do their clients. Each round times both one
after the other; what is told is the median of the ratios of the rounds, and the median of the rates.
"""

import statistics
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "src" / "franka_sim" / "test"))
from fci_peer import control_box

CYCLES = 5000
ROUNDS = 7
CLIENTS = {
    "panda": """
import sys, time
from panda_py import libfranka as franka
robot, cycles = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore), int(sys.argv[2])
def callback(state, period):
    global count
    count += 1
    torques = franka.Torques([0.0] * 7)
    return franka.motion_finished(torques) if count == cycles else torques
for line in sys.stdin:
    count, begin = 0, time.perf_counter()
    robot.control(callback)
    print(cycles / (time.perf_counter() - begin), robot.read_once().time.to_sec(), flush=True)
""",
    "fr3": """
import sys, time
import pylibfranka as franka
robot, cycles = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore), int(sys.argv[2])
for line in sys.stdin:
    begin, control = time.perf_counter(), robot.start_torque_control()
    for count in range(1, cycles + 1):
        state, period = control.readOnce()
        torques = franka.Torques([0.0] * 7)
        torques.motion_finished = count == cycles
        control.writeOnce(torques)
    del control
    print(cycles / (time.perf_counter() - begin), robot.read_once().time.to_sec(), flush=True)
""",
}
"""Time each round of a bare callback, when told by a line."""


@dataclass(frozen=True)
class Rate:
    """Rates of a bare torque callback.

    Attributes:
        constant_hz: against a constant state [Hz].
        arm_hz: against the arm [Hz].
        ratio: of the second to the first, median of the rounds [1].
    """

    constant_hz: float
    arm_hz: float
    ratio: float


@contextmanager
def _client(robot: str, ip: str) -> Iterator[subprocess.Popen[str]]:
    words = [sys.executable, "-c", CLIENTS[robot], ip, str(CYCLES)]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def _round(client: subprocess.Popen[str]) -> float:
    assert client.stdin is not None and client.stdout is not None
    client.stdin.write("go\n")
    client.stdin.flush()
    return float(client.stdout.readline().split()[0])


def measure(robot: str = "panda", words: tuple[str, ...] = (), rounds: int = ROUNDS) -> Rate:
    """Rates of both.

    Args:
        robot: "panda" or "fr3".
        words: more of the command of the arm, e.g. ("--no-collision",).
        rounds: how many.
    """
    common = ("--robot", robot, "--real-time-factor", "0")
    with ExitStack() as stack:
        clients = []
        for own in (("--constant",), words):
            ip, _ = stack.enter_context(control_box(*common, *own))
            clients.append(stack.enter_context(_client(robot, ip)))
        for client in clients:
            _round(client)  # warm
        rates = [[_round(client) for client in clients] for _ in range(rounds)]
    constant, arm = zip(*rates, strict=True)
    return Rate(statistics.median(constant), statistics.median(arm), statistics.median(b / a for a, b in rates))


if __name__ == "__main__":
    chosen = sys.argv[1] if len(sys.argv) > 1 else "panda"
    rate = measure(chosen, tuple(sys.argv[2:]))
    print(
        f"{chosen}: {rate.arm_hz:.0f} Hz against the arm, {rate.constant_hz:.0f} Hz against a constant state, "
        f"ratio {rate.ratio:.2f}"
    )
