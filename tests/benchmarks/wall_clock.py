"""Measure how FrankaHW and its controllers keep up with a control box at wall-clock time, both with real-time priority.

    python tests/benchmarks/wall_clock.py [panda|fr3] [seconds] [word of the control_box command ...]

The box is a process of its own, and ends the motion after 20 lost commands as the arm does. FrankaHW runs with its
usual parameters (SCHED_FIFO 80, memory locked) and three controllers (joint and Franka states, joint PD), on a node
without ROS. After a third of the time another controller of the same mode is loaded, then switched to; after two thirds
one of another mode. When the arm ends the motion in a reflex, that is noted by name, the arm recovers as through
`franka_control/error_recovery`, and the motion goes on, until it has lasted for the time asked for. Figures depend on
the machine and its load, which is told beside them, with the time that its host took away (steal, of /proc/stat).
"""

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
from hric_control.manager.controller_manager import import_controllers
from hric_run.definition import parameters

PRIORITY = 85
"""SCHED_FIFO priority of the control box, above that of the client, since nothing delays a real one."""
FIRST, SECOND, OTHER = (
    "joint_pd_controller",
    "effort_joint_trajectory_controller",
    "position_joint_trajectory_controller",
)
WINDOW = 100
"""Number of cycles in the success rate of the arm."""
PATIENCE = 4.0
"""Maximum duration as a multiple of the requested motion time, for an arm that repeatedly ends the motion [1]."""
AFTERWARDS = 0.05
"""Time after an event in which lost states are attributed to it [s of robot time]."""


@dataclass
class Event:
    """Change of controllers during the motion.

    Attributes:
        name: description of the change.
        begin, end: robot time [s].
        lost: number of states lost during it and shortly afterwards.
    """

    name: str
    begin: float
    end: float = 0.0
    lost: int = 0


@dataclass
class WallClock:
    """Result of a measurement.

    Attributes:
        seconds: robot time of the motions [s].
        rates: control_command_success_rate of each cycle, without the first 100 of each motion, in which it rises [1].
        losses: numbers of successive states that were lost or late.
        events: loading and switching of controllers.
        stops: motion time [s] and libfranka's error of each end of the motion by the arm, after which it recovered.
        stolen: share of the processor time that the host of the machine gave to others [1].
    """

    seconds: float = 0.0
    rates: list[float] = field(default_factory=list)
    losses: list[int] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    stops: list[tuple[float, str]] = field(default_factory=list)
    stolen: float = 0.0


class Watch:
    """Recorder of time and success rate of each cycle during motion, which also recovers the arm from reflexes.

    Args:
        robot: robot, which is stopped after `seconds` of motion.
    """

    def __init__(self, robot: Robot, seconds: float) -> None:
        self._hw, self.times, self.rates = robot.hw, [], []  # type: FrankaHW, list[float], list[float]
        self.stops: list[tuple[float, str]] = []
        self._enough = round(seconds * 1e3)
        self.now, self._mode, self._cycles = 0.0, robot.hw.mode, 0

    def __call__(self, now: float) -> None:
        """Record a cycle; called before the controllers."""
        self.now = now
        if self._hw.mode.commanded:
            self._cycles = self._cycles + 1 if self._hw.mode == self._mode else 0
            self.times.append(now)
            if self._cycles > WINDOW:
                self.rates.append(self._hw.robot_state.control_command_success_rate)
        self._mode = self._hw.mode
        if self._hw.error:
            self.stops.append((now, self._hw.error))
            self._hw.recover()
        if len(self.times) >= self._enough:
            self._hw.stop()

    @property
    def motion(self) -> float:
        """Time for which the arm was commanded [s]."""
        return len(self.times) * 1e-3

    def lost(self, begin: float, end: float) -> list[int]:
        """Return the numbers of missing milliseconds between successive cycles within a time interval [s]."""
        pairs = zip(self.times, self.times[1:], strict=False)
        ended = [time for time, _ in self.stops]
        gaps = [
            round((b - a) * 1e3) - 1
            for a, b in pairs
            if begin <= b <= end and not any(a <= time <= b for time in ended)
        ]
        return [gap for gap in gaps if gap > 0]


def _disturb(robot: Robot, watch: Watch, seconds: float, events: list[Event]) -> None:
    """Load and switch controllers at their times, in a separate thread like a service."""
    manager = robot.manager

    def at(share: float, name: str, act: Callable[[], None]) -> None:
        while watch.motion < share * seconds:
            time.sleep(0.01)
        event = Event(name, watch.now)
        act()
        event.end = watch.now + AFTERWARDS
        events.append(event)

    at(0.30, f"load {SECOND}", lambda: manager.load(SECOND))
    at(0.35, f"switch to it within the mode ({FIRST} stops)", lambda: manager.switch([SECOND], [FIRST]))
    at(0.60, f"load {OTHER}", lambda: manager.load(OTHER))
    at(
        0.65,
        "switch to it, another mode: the loop of libfranka is left and the next one entered",
        lambda: manager.switch([OTHER], [SECOND]),
    )


def measure(robot: str = "panda", seconds: float = 60.0, words: tuple[str, ...] = ()) -> WallClock:
    """Run the motion, and return the result.

    Args:
        robot: "panda" or "fr3".
        seconds: robot time [s].
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
    watch, before = Watch(arm, seconds), _processor_time()
    thread = threading.Thread(target=_disturb, args=(arm, watch, seconds, found.events), daemon=True)
    thread.start()
    arm.run(PATIENCE * seconds, watch)
    found.stops, found.seconds, found.rates = watch.stops, watch.motion, watch.rates
    found.stolen = (_processor_time()[1] - before[1]) / max(1, _processor_time()[0] - before[0])
    found.losses = watch.lost(0.0, float("inf"))
    for event in found.events:
        event.lost = sum(watch.lost(event.begin, event.end))


def _processor_time() -> tuple[int, int]:
    """Return the time of all processors, and the part taken by the host, in kernel ticks."""
    with open("/proc/stat") as file:
        ticks = [int(word) for word in file.readline().split()[1:9]]
    return sum(ticks), ticks[7]


def report(robot: str, found: WallClock) -> str:
    """Return the figures as text."""
    rates = found.rates or [0.0]
    lines = [
        f"{robot}: {found.seconds:.1f} s of motion; load of the machine {os.getloadavg()[0]:.1f} on "
        f"{os.cpu_count()} processors, "
        f"{found.stolen:.1%} of them taken by its host",
        f"success rate: mean {statistics.fmean(rates):.4f}, lowest {min(rates):.2f}",
        f"states lost: {sum(found.losses)} on {len(found.losses)} occasions, at most "
        f"{max(found.losses, default=0)} in a row",
        *(
            f"{event.name}: {event.lost} cycles lost in {1e3 * (event.end - event.begin - AFTERWARDS):.0f} ms"
            for event in found.events
        ),
        *(f"ended by the arm at {time:.1f} s, recovered: {why}" for time, why in found.stops),
        *([] if found.stops else ["the controllers survived"]),
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    chosen = sys.argv[1] if len(sys.argv) > 1 else "panda"
    print(report(chosen, measure(chosen, float(sys.argv[2]) if len(sys.argv) > 2 else 60.0, tuple(sys.argv[3:]))))
