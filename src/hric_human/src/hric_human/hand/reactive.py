"""Hand that reacts to the robot: it takes an object over from the arm at rest and draws back.

The hand also draws back when the arm comes too near, or when the force on the hand is too strong. Each motion is the
polynomial of fifth degree from the present position, velocity and acceleration to rest at the goal: from rest this is
the minimum-jerk motion (Flash and Hogan 1985), and if the goal changes on the way the acceleration stays continuous.
"""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from hric_core.geometry import FloatArray, Pose, Vector
from hric_core.parameters import Settings, number, numbers, refused, section, whole
from hric_human.hand.program import Program

STEP = 0.01
"""Time between two decisions [s] (project default, unconfirmed)."""
SPEED_SPAN = 0.1
"""Time over which the arm's speed is measured [s] (project default, unconfirmed)."""
NEW_GOAL = 5e-3
"""Displacement of the arm above which the goal of an approach follows it [m] (project default, unconfirmed)."""
MIN_TIME = 0.3
"""Shortest remaining duration of a motion whose goal changed [s] (project default, unconfirmed)."""
KEPT = 2.0
"""Time for which observations and planned motions are stored [s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class ReactionVariation(Settings):
    """Standard deviations of the random variation of a hand's reactions."""

    position: float = number(0.0, minimum=0.0, maximum=0.1, unit="m", text="of the goal of each approach, per axis")
    time: float = number(0.0, minimum=0.0, maximum=0.3, text="of the logarithm of durations")


@dataclass(frozen=True)
class Reaction(Settings):
    """Parameters of the hand's reactions."""

    rest: Vector = numbers(3, (0.75, -0.45, 0.35), unit="m", text="where it rests")
    standoff: float = number(
        0.12,
        above=0.0,
        maximum=1.0,
        unit="m",
        text="distance from the end effector at which the hand takes the object over, on the side of its rest position",
    )
    delay: float = number(
        0.25,
        minimum=0.05,
        maximum=1.0,
        unit="s",
        name="reaction_delay",
        text="from a motion of the robot to the hand's reaction: simple visual reaction time of adults, about a "
        "quarter of a second",
    )
    still_speed: float = number(0.02, above=0.0, maximum=1.0, unit="m/s", text="an arm that is slower is at rest")
    too_near: float = number(
        0.06, minimum=0.0, unit="m", text="the hand draws back from an end effector that is nearer; 0: never"
    )
    too_strong: float = number(
        0.0,
        minimum=0.0,
        unit="N",
        text="the hand draws back from a larger force while it approaches or pauses; 0: never",
    )
    touch_delay: float = number(
        0.05,
        minimum=0.05,
        maximum=1.0,
        unit="s",
        text="from a sensed force to the hand's reaction; with the delay of the force sense about 0.13 s, the haptic "
        "reaction time of adults (110 to 150 ms, unconfirmed)",
    )
    approach: float = number(1.2, minimum=0.2, maximum=10.0, unit="s", text="duration")
    pause: float = number(0.8, minimum=0.0, maximum=60.0, unit="s", text="duration")
    retreat: float = number(1.0, minimum=0.2, maximum=10.0, unit="s", text="duration")
    dwell: float = number(0.5, minimum=0.0, maximum=60.0, unit="s", text="at rest between two hand-overs")
    repeats: int = whole(2, minimum=1, maximum=1000, text="hand-overs")
    variation: ReactionVariation = section(ReactionVariation)

    def check(self, where: str) -> None:
        """Check that too_near is at most the standoff, or the hand would never take over. Raises ParameterError."""
        super().check(where)
        if self.too_near > self.standoff:
            raise refused(
                f"{where}too_near", self.too_near, f"a finite number from 0 to standoff, {self.standoff:g} [m]"
            )


class Piece:
    """Fifth-degree polynomial motion from a position, velocity and acceleration to rest at a goal, where it stays.

    Args:
        begin: start time [s].
        duration: duration [s], above 0.
        state: position, velocity, acceleration at the start, shape (3, 3) [m, s].
        goal: final position, shape (3,) [m].
    """

    def __init__(self, begin: float, duration: float, state: FloatArray, goal: FloatArray) -> None:
        self.begin, self.duration, self.goal = begin, duration, goal
        p, v, a = state[0], state[1] * duration, state[2] * duration**2
        d = goal - p
        self._c = np.array([p, v, a / 2, 10 * d - 6 * v - 1.5 * a, -15 * d + 8 * v + 1.5 * a, 6 * d - 3 * v - a / 2])

    def state(self, time: float) -> FloatArray:
        """Return position, velocity, acceleration, shape (3, 3) [m, s]."""
        u, T = min(max((time - self.begin) / self.duration, 0.0), 1.0), self.duration
        if u == 1.0:
            return np.array([self.goal, np.zeros(3), np.zeros(3)])
        powers = np.array([
            [1.0, u, u**2, u**3, u**4, u**5],
            [0.0, 1.0, 2 * u, 3 * u**2, 4 * u**3, 5 * u**4],
            [0.0, 0.0, 2.0, 6 * u, 12 * u**2, 20 * u**3],
        ])  # fmt: skip
        return np.asarray(powers @ self._c / np.array([[1.0], [T], [T * T]]))


class Reactive(Program):
    """Program of a hand that takes objects over from a resting arm, and draws back if it is too near or too forceful.

    Its phases are rest, approach, pause, retreat and done.

    Args:
        reaction: parameters of the reactions.
        random: generator of all random variation.
    """

    def __init__(self, reaction: Reaction, random: np.random.Generator) -> None:
        self._how, self._random = reaction, random
        self._home = np.array(reaction.rest)
        still = np.array([self._home, np.zeros(3), np.zeros(3)])
        self._pieces = deque([Piece(0.0, STEP, still, self._home)])
        self._phases: deque[tuple[float, str]] = deque([(-math.inf, "rest")])
        self._observed: deque[tuple[float, FloatArray]] = deque()
        self._hurt = math.inf
        self._next, self._until = 0, reaction.dwell
        self._left, self._shift = reaction.repeats, np.zeros(3)
        self._decide: dict[str, Callable[[float], None]] = {
            "rest": self._at_rest,
            "approach": self._on_approach,
            "pause": self._on_pause,
            "retreat": self._on_retreat,
        }

    def see(self, time: float, position: Vector) -> None:
        """Store the position [m] of the robot's end effector observed at `time` [s]."""
        if not self._observed or time > self._observed[-1][0]:
            self._observed.append((time, np.array(position)))

    def feel(self, time: float, force: Vector) -> None:
        """Store the time of a force above `too_strong`, to which the hand then reacts by drawing back."""
        if 0.0 < self._how.too_strong < math.hypot(*force):
            self._hurt = min(self._hurt, time)

    @property
    def span(self) -> tuple[float, float]:
        """Start 0 and an infinite end, since the motion depends on the robot."""
        return 0.0, math.inf

    def pose(self, time: float) -> Pose:
        """Return the pose of the hand, after all decisions up to `time`."""
        self._advance(time)
        x, y, z = self._state(time)[0].tolist()
        return Pose((x, y, z))

    def phase(self, time: float) -> str:
        """Return the phase of the hand, after all decisions up to `time`."""
        self._advance(time)
        return self._phases[max(0, bisect_right(self._phases, time, key=itemgetter(0)) - 1)][1]

    def _advance(self, time: float) -> None:
        """Take all decisions up to `time`, on a fixed grid, so that they do not depend on the times of calls."""
        while self._next * STEP <= time:
            now = self._next * STEP
            if decide := self._decide.get(self._phases[-1][1]):
                decide(now)
            self._next += 1
            while len(self._pieces) > 1 and self._pieces[1].begin < now - KEPT:
                self._pieces.popleft()
            while len(self._observed) > 1 and self._observed[1][0] < now - KEPT - self._how.delay:
                self._observed.popleft()

    def _state(self, time: float) -> FloatArray:
        index = max(0, bisect_right(self._pieces, time, key=lambda piece: piece.begin) - 1)
        return self._pieces[index].state(time)

    def _perceived(self, now: float) -> FloatArray | None:
        """Return the end effector's position one reaction time ago [m]; None if unknown."""
        index = bisect_right(self._observed, now - self._how.delay, key=itemgetter(0)) - 1
        return self._observed[index][1] if index >= 0 else None

    def _at_rest(self, now: float) -> None:
        self._hurt = math.inf
        arm, before = self._perceived(now), self._perceived(now - SPEED_SPAN)
        if now < self._until or arm is None or before is None:
            return
        if np.linalg.norm(arm - before) <= self._how.still_speed * SPEED_SPAN:
            self._shift = self._how.variation.position * self._random.standard_normal(3)
            self._go("approach", now, self._goal(arm), self._varied(self._how.approach))

    def _goal(self, arm: FloatArray) -> FloatArray:
        """Return the hand-over point [m], the standoff away from the arm's position towards the rest position."""
        to_home = self._home - arm
        share = min(1.0, self._how.standoff / max(float(np.linalg.norm(to_home)), 1e-9))
        return np.asarray(arm + to_home * share + self._shift)

    def _on_approach(self, now: float) -> None:
        if self._shies(now):
            return
        if now >= self._until:
            self._enter("pause", now, self._varied(self._how.pause))
            return
        arm = self._perceived(now)
        if arm is not None and np.linalg.norm(self._goal(arm) - self._pieces[-1].goal) > NEW_GOAL:
            self._go("approach", now, self._goal(arm), max(self._until - now, MIN_TIME))

    def _on_pause(self, now: float) -> None:
        if not self._shies(now) and now >= self._until:
            self._retreat(now)

    def _on_retreat(self, now: float) -> None:
        self._hurt = math.inf
        if now >= self._until:
            self._left -= 1
            self._enter("rest" if self._left > 0 else "done", now, self._varied(self._how.dwell))

    def _shies(self, now: float) -> bool:
        """Return True, and start to draw back, if the arm is too near or the force too strong."""
        arm = self._perceived(now)
        near = arm is not None and float(np.linalg.norm(arm - self._state(now)[0])) < self._how.too_near
        shies = near or self._hurt <= now - self._how.touch_delay
        if shies:
            self._retreat(now)
        return shies

    def _retreat(self, now: float) -> None:
        self._go("retreat", now, self._home, self._varied(self._how.retreat))

    def _go(self, phase: str, now: float, goal: FloatArray, duration: float) -> None:
        self._pieces.append(Piece(now, duration, self._state(now), goal))
        self._enter(phase, now, duration)

    def _enter(self, phase: str, now: float, duration: float) -> None:
        if phase != self._phases[-1][1]:
            self._phases.append((now, phase))
        self._until = now + duration

    def _varied(self, duration: float) -> float:
        return duration * math.exp(self._how.variation.time * self._random.standard_normal())
