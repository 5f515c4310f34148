"""`hric control_box EXPERIMENT`: unmodified libfranka clients, each in a process of its own, move the arms of one world
through two emulated control boxes."""

import ipaddress
import json
import math
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest
from fci_peer import PATIENCE, control_box, log_of, new_address, wait_for_log
from two_arm_clients import FOLLOW_FR3, FOLLOW_PANDA, LEAD, MOVE

pytestmark = pytest.mark.alone
START = [0.0, -math.pi / 4, 0.0, -3.0 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4]
GOAL = [0.4, -0.6, 0.2, -2.2, 0.1, 1.7, 0.9]
MEETING = [0.9, -0.6, 0.0, -1.9, 0.0, 1.4, math.pi / 4]
"""Pose of the left arm of the experiment two_arms_contact in which the arms touch; the right arm mirrors joint 1."""
SPEED = 35.0 / 16.0
"""Maximum of the derivative of the motion's profile s(x), at x = 1/2."""


class Program:
    """Client in a process of its own; `words`: its arguments."""

    def __init__(self, code: str, *words: object) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, *map(str, words)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def line(self) -> str:
        """Return the next line of its output."""
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def go(self) -> None:
        """Let it begin its motion."""
        assert self.process.stdin is not None
        self.process.stdin.write("go\n")
        self.process.stdin.flush()

    def result(self) -> dict[str, Any]:
        """Return what it prints at its end."""
        output, errors = self.process.communicate(timeout=2.0 * PATIENCE)
        assert self.process.returncode == 0, errors
        result: dict[str, Any] = json.loads(output.splitlines()[-1])
        return result


@contextmanager
def boxes(*words: str) -> Iterator[tuple[list[str], subprocess.Popen[str], Any]]:
    """Run the control boxes of an experiment with two arms; yield their addresses, the process, and a function that
    starts a client."""
    with control_box(*words, ip=new_address()) as (left, process), ExitStack() as started:

        def start(code: str, *arguments: object) -> Program:
            program = Program(code, *arguments)
            started.callback(program.process.communicate)
            started.callback(program.process.kill)
            return program

        yield [left, str(ipaddress.IPv4Address(left) + 1)], process, start


def both_move(start: Any, addresses: list[str], goals: list[list[float]], seconds: float) -> list[Program]:
    """Start two clients, let them move together, and wait until both have commanded 300 cycles."""
    programs = [start(MOVE, ip, goal, seconds) for ip, goal in zip(addresses, goals, strict=True)]
    assert [program.line() for program in programs] == ["connected"] * 2
    for program in programs:
        program.go()
    assert [program.line() for program in programs] == ["runs"] * 2
    return programs


@pytest.mark.parametrize(("robot", "follow"), [("panda", FOLLOW_PANDA), ("fr3", FOLLOW_FR3)])
def test_a_client_follows_the_measured_joints_of_the_other_arm(robot: str, follow: str, figure: Any) -> None:
    inertials = [f"arms.right.robot.description.inertials:={robot}"] if robot == "fr3" else []
    with boxes("two_arms", *inertials, "--real-time-factor", "0") as ((left, right), _, start):
        follower = start(follow, right, "[]", 0.0)
        leader = start(LEAD, left, GOAL, 2.0, follower.line())
        assert leader.line() == "connected"
        leader.go()
        led, followed = leader.result(), follower.result()
    assert led["error"] == followed["error"] == "" and led["rate"] == followed["rate"] == 1.0
    assert led["q"] == pytest.approx(GOAL, abs=1e-4) and followed["q"][:6] == pytest.approx(GOAL[:6], abs=2e-3)
    # Joint 1 is the fastest. The impedance controller has no velocity of the leader: it lags by damping / stiffness.
    # Streamed positions lag by libfranka's low-pass filter at 100 Hz, 1.6 ms, and by at most a cycle beside it.
    speed = SPEED * (GOAL[0] - START[0]) / 2.0
    figure(f"two boxes, {robot} follows a panda: largest tracking error", followed["tracking"], "rad")
    if robot == "fr3":
        assert followed["tracking"] == pytest.approx(50.0 / 600.0 * speed, rel=0.05)
    else:
        assert 1.5e-3 * speed < followed["tracking"] < 2.6e-3 * speed


def test_arms_that_touch_stop_each_other_with_equal_and_opposite_forces() -> None:
    goals = [MEETING, [-MEETING[0], *MEETING[1:]]]
    with boxes("two_arms_contact", "robot.parameters.reflexes:=true", "--real-time-factor", "0") as (
        addresses,
        process,
        start,
    ):
        results = [program.result() for program in both_move(start, addresses, goals, 1.5)]
        log = log_of(process)
    for result in results:
        assert "cartesian_reflex" in result["errors"] and "reflex" in result["error"], result
        assert result["mode"].endswith("Reflex")
    left, right = (float(re.search(rf"{name}: .*\(force y at (\S+) N", log)[1]) for name in ("left", "right"))  # type: ignore[index]
    assert left < -20.0 and left == pytest.approx(-right, rel=0.05)


def test_an_arm_that_touches_the_person_stops_and_the_other_arm_moves_on() -> None:
    goals = [[0.75, *START[1:]], [-0.2, *START[1:]]]
    with boxes("two_arms_contact", "robot.parameters.reflexes:=true", "--real-time-factor", "0") as (
        addresses,
        _,
        start,
    ):
        left, right = (program.result() for program in both_move(start, addresses, goals, 1.5))
    assert "cartesian_reflex" in left["errors"] and left["q"][0] < 0.7
    assert right["error"] == "" and (right["cycles"], right["rate"]) == (1502, 1.0)
    assert right["q"] == pytest.approx(goals[1], abs=1e-3) and right["force"] < 1.0


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_a_client_that_dies_or_hangs_leaves_the_other_arm_every_cycle(end: signal.Signals) -> None:
    with boxes("two_arms") as (addresses, process, start):
        left, right = both_move(start, addresses, [GOAL, GOAL], 4.0)
        left.process.send_signal(end)
        if end is signal.SIGSTOP:
            wait_for_log(process, "left: motion aborted by reflex: communication_constraints_violation")
        result = right.result()
        log = log_of(process)
    assert result["error"] == "" and (result["cycles"], result["rate"]) == (4002, 1.0)
    assert result["q"] == pytest.approx(GOAL, abs=1e-3)
    assert result["pace"] > 0.5, "the world waits for nobody at the end"
    assert "right: motion aborted" not in log
    if end is signal.SIGKILL:
        assert "communication_constraints_violation" not in log, "the end of the connection ends the motion at once"
