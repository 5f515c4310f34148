"""How FrankaHW and its controllers keep up with an arm that does not wait: the emulated control box by the wall clock, both with real-time priority.

    python tests/benchmarks/wall_clock.py [panda|fr3] [seconds] [word of the control_box command ...]

The box is a process of its own, and ends the motion after 20 lost commands as the arm does. FrankaHW runs with its usual parameters (SCHED_FIFO 80,
memory locked) and three controllers (joint and Franka states, joint PD), on a node without ROS. After a third of the time another controller of the
same mode is loaded, then switched to; after two thirds one of another mode. Figures depend on the machine and its load, which is told beside them.
"""

from __future__ import annotations

import os
import statistics
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "src" / "franka_sim" / "test"))
sys.path.insert(0, str(Path(__file__).parents[2] / "src" / "franka_real" / "test"))
from driven_robot import Robot
from fci_peer import control_box

from franka_real.franka_hw import FrankaHW
from hric_control.robot_app import import_controllers
from hric_experiments import parameters

PRIORITY = 85
"""SCHED_FIFO of the box, above that of the client, as nothing delays a real one."""
FIRST, SECOND, OTHER = "joint_pd_controller", "effort_joint_trajectory_controller", "position_joint_trajectory_controller"
WINDOW = 100
"""Cycles over which the arm takes its success rate."""
AFTERWARDS = 0.05
"""A loss so long after an event still counts as its own [s of run time]."""


@dataclass
class Event:
    """Something done to the controllers while they run.

    Attributes:
        name: what.
        begin, end: run time [s].
        lost: states that never came in between and shortly afterwards.
    """

    name: str
    begin: float
    end: float = 0.0
    lost: int = 0


@dataclass
class WallClock:
    """What happened.

    Attributes:
        seconds: run time of the motions [s].
        rates: control_command_success_rate of each cycle, but for the first 100 of each motion, which it still counts up [1].
        losses: states that never came, or came late, at a time.
        events: loading and switching.
        error: why the arm ended the motion before its time, in libfranka's words; empty if it did not.
    """

    seconds: float = 0.0
    rates: list[float] = field(default_factory=list)
    losses: list[int] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    error: str = ""


class Watch:
    """Notes time and success rate of each cycle while the arm is commanded."""

    def __init__(self, robot: Robot) -> None:
        self._hw, self.times, self.rates = robot.hw, [], []  # type: FrankaHW, list[float], list[float]
        self.now, self._mode, self._cycles = 0.0, robot.hw.mode, 0

    def __call__(self, now: float) -> None:
        """Each cycle, before the controllers."""
        self.now = now
        if self._hw.mode.commanded:
            self._cycles = self._cycles + 1 if self._hw.mode == self._mode else 0
            self.times.append(now)
            if self._cycles > WINDOW:
                self.rates.append(self._hw.robot_state.control_command_success_rate)
        self._mode = self._hw.mode
        if self._hw.error:
            self._hw.stop()

    def lost(self, begin: float, end: float) -> list[int]:
        """Milliseconds that are missing between two cycles, wherever some are, within a time [s]."""
        pairs = zip(self.times, self.times[1:], strict=False)
        gaps = [round((b - a) * 1e3) - 1 for a, b in pairs if begin <= b <= end]
        return [gap for gap in gaps if gap > 0]


def _disturb(robot: Robot, watch: Watch, seconds: float, events: list[Event]) -> None:
    """Load and switch at their times; from a thread of its own, as a service would."""
    manager = robot.manager

    def at(share: float, name: str, act: Callable[[], None]) -> None:
        while watch.now < share * seconds and not robot.hw.error:
            time.sleep(0.01)
        if not robot.hw.error:
            event = Event(name, watch.now)
            act()
            event.end = watch.now + AFTERWARDS
            events.append(event)

    at(0.30, f"load {SECOND}", lambda: manager.load(SECOND))
    at(0.35, f"switch to it within the mode ({FIRST} stops)", lambda: manager.switch([SECOND], [FIRST]))
    at(0.60, f"load {OTHER}", lambda: manager.load(OTHER))
    at(0.65, "switch to it, another mode: the loop of libfranka is left and the next one entered", lambda: manager.switch([OTHER], [SECOND]))


def measure(robot: str = "panda", seconds: float = 60.0, words: tuple[str, ...] = ()) -> WallClock:
    """Run it.

    Args:
        robot: "panda" or "fr3".
        seconds: run time [s].
        words: more of the command of the box.
    """
    found = WallClock()
    given = ("--robot", robot, "--clock", "wall", "--priority", str(PRIORITY), "--no-collision", *words)
    with control_box(*given) as (ip, _):
        arm = Robot(FrankaHW(), {**parameters.defaults("panda"), "robot": {"robot_ip": ip, "robot": robot}})
        try:
            _run(arm, seconds, found)
        finally:
            arm.close()
    return found


def _run(arm: Robot, seconds: float, found: WallClock) -> None:
    import_controllers(arm.node)  # as the robot's node does before anybody can ask for one
    names = ["joint_state_controller", "franka_state_controller", FIRST]
    for name in names:
        arm.manager.load(name)
    arm.switch(names, [])
    watch = Watch(arm)
    thread = threading.Thread(target=_disturb, args=(arm, watch, seconds, found.events), daemon=True)
    thread.start()
    arm.run(seconds, watch)
    found.error, found.seconds, found.rates = arm.hw.error, len(watch.times) * 1e-3, watch.rates
    found.losses = watch.lost(0.0, seconds + 1.0)
    for event in found.events:
        event.lost = sum(watch.lost(event.begin, event.end))


def report(robot: str, found: WallClock) -> str:
    """The figures as text."""
    rates = found.rates or [0.0]
    lines = [
        f"{robot}: {found.seconds:.1f} s of motion; load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors",
        f"success rate: mean {statistics.fmean(rates):.4f}, lowest {min(rates):.2f}",
        f"states lost: {sum(found.losses)} on {len(found.losses)} occasions, at most {max(found.losses, default=0)} in a row",
        *(f"{event.name}: {event.lost} cycles lost in {1e3 * (event.end - event.begin - AFTERWARDS):.0f} ms" for event in found.events),
        f"ended by the arm: {found.error}" if found.error else "the controllers survived",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    chosen = sys.argv[1] if len(sys.argv) > 1 else "panda"
    print(report(chosen, measure(chosen, float(sys.argv[2]) if len(sys.argv) > 2 else 60.0, tuple(sys.argv[3:]))))
