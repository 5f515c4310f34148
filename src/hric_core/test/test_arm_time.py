"""Robot time from the arm's clock, and the stamps that follow it."""

from itertools import pairwise

import genpy
import pytest

from hric_core.local.node import LocalNode
from hric_core.robot_time import arm_time
from hric_core.robot_time.arm_time import ArmTime


class WallNode:
    """A node whose time is this machine's, as rospy's without /use_sim_time."""

    clock = None

    def __init__(self, machine) -> None:
        self.now = lambda: genpy.Time.from_sec(machine.time())


class Machine:
    """Clock of the machine that the test sets."""

    def __init__(self, begin: float) -> None:
        self.value = begin

    def time(self) -> float:
        return self.value


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    made = Machine(1.7e9)
    monkeypatch.setattr(arm_time, "wall", made)
    return made


def test_it_begins_at_zero_and_counts_the_arms_milliseconds() -> None:
    time = ArmTime([LocalNode()])
    periods = [time.advance(ms) for ms in (70_000, 70_001, 70_004, 70_004, 70_003, 70_005)]
    assert periods == pytest.approx([0.001, 0.001, 0.003, 0.0, 0.0, 0.001])
    assert time.time == pytest.approx(0.005)


def test_on_a_local_node_stamps_are_robot_time() -> None:
    node = LocalNode()
    child = node.child("robot")
    time = ArmTime([node])
    for ms in range(500, 600):
        time.advance(ms)
    assert child.now().to_sec() == pytest.approx(0.099)
    assert time.epoch == 0.0


def test_stamps_are_those_of_the_measurement_whatever_the_machine_is_late(machine) -> None:
    node = WallNode(machine)
    time, stamps = ArmTime([node]), []
    for ms in range(1000):
        machine.value = 1.7e9 + 0.001 * ms + (0.03 if ms % 7 else 0.0)
        time.advance(ms)
        stamps.append(node.clock())
    assert stamps[-1] - stamps[0] == pytest.approx(0.999, abs=1e-6)
    assert all(b > a for a, b in pairwise(stamps))


@pytest.mark.parametrize("pace", [0.5, 0.999, 1.001, 3.0])
def test_where_the_clocks_drift_apart_stamps_stay_with_this_machine_and_never_go_back(machine, pace) -> None:
    node = WallNode(machine)
    time, worst, last = ArmTime([node]), 0.0, 0.0
    for ms in range(20_000):
        machine.value = 1.7e9 + 0.001 * ms / pace
        time.advance(ms)
        stamp = node.clock()
        assert stamp >= last
        last, worst = stamp, max(worst, abs(stamp - machine.value))
    assert worst < 0.25
    assert time.time == pytest.approx(19.999)
