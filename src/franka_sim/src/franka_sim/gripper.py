"""Emulated Franka hand: two fingers at constant speed, and an object between them. No ROS, no physics engine."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from franka_hw_interface.hand import HandMotion, HandOutcome
from hric_core.errors import CommandError
from hric_core.node import LiveParameter, Node, ParameterValues
from hric_core.parameters import Settings, number, package_yaml, whole

__all__ = ["Gripper", "HandConfig", "HandMotion", "HandOutcome", "defaults"]


@dataclass(frozen=True)
class HandConfig(Settings):
    """Parameters of the emulated hand, explained in config/hand.yaml."""

    max_width: float = number(above=0.0, unit="m")
    max_speed: float = number(above=0.0, unit="m/s")
    max_force: float = number(above=0.0, unit="N")
    homing_speed: float = number(above=0.0, unit="m/s")
    temperature: int = whole(unit="degrees Celsius")


@dataclass(slots=True)
class _Task:
    """Running motion: segments of (target opening [m], speed [m/s]), and a function that judges its end.

    The function returns the reason of a failure, or an empty text.
    """

    motion: HandMotion
    legs: list[tuple[float, float]]
    judge: Callable[[bool], str]  # argument: True if an object stopped the fingers


class Gripper:
    """Emulated Franka hand.

    Requests return at once with a `HandMotion`, which `step` executes; a new request aborts the running one. Speeds are
    rates of the opening. A move stops at an object; a grasp moves towards the expected width and on until the fingers
    are stopped by an object, by each other, or at the end of their range. After a grasp the fingers continue to press:
    if the object is removed, they close and `is_grasped` becomes False. One instance serves one thread.

    Args:
        config: parameters; those of config/hand.yaml by default.

    Attributes:
        width: opening between the fingers [m]; fully open at the start.
        is_grasped: True while an object of the expected width is held.
        force: force with which the fingers press [N], 0 when they do not hold.
    """

    def __init__(self, config: HandConfig | None = None) -> None:
        self.config = config or defaults()
        self.width = self.config.max_width
        self.is_grasped = False
        self.force = 0.0
        self._object: float | None = None
        self._time: float | None = None
        self._task: _Task | None = None
        self._hold: tuple[float, float, float, float] | None = (
            None  # (target opening, speed, minimum and maximum object width)
        )

    @property
    def max_width(self) -> float:
        """Maximum opening [m]."""
        return self.config.max_width

    @property
    def temperature(self) -> int:
        """Temperature of the hand [degrees Celsius]."""
        return self.config.temperature

    @property
    def object_width(self) -> float | None:
        """Width of the object between the fingers [m], None without an object.

        Raises:
            CommandError: set to a width that does not fit between the fully open fingers.
        """
        return self._object

    @object_width.setter
    def object_width(self, width: float | None) -> None:
        if width is not None and not 0.0 < width <= self.max_width:
            raise CommandError(
                f"an object {width} m wide does not fit between the fingers; valid: above 0, to {self.max_width:g} m"
            )
        self._object = width

    def homing(self) -> HandMotion:
        """Close, then open fully; unsuccessful if an object prevents the fingers from closing."""
        speed = self.config.homing_speed
        return self._begin("homing", "", [(0.0, speed), (self.max_width, speed)], self._unblocked)

    def move(self, width: float, speed: float) -> HandMotion:
        """Move to an opening [m] at a speed [m/s]; unsuccessful if an object is in the way."""
        return self._begin("move", self._wrong(width, speed), [(width, speed)], self._unblocked)

    def grasp(self, width: float, epsilon_inner: float, epsilon_outer: float, speed: float, force: float) -> HandMotion:
        """Grasp an object of an expected width.

        Success if at rest `width - epsilon_inner < opening < width + epsilon_outer` (libfranka, Gripper::grasp); the
        fingers then continue to press.

        Args:
            width: expected width [m].
            epsilon_inner: tolerance for a narrower object [m].
            epsilon_outer: tolerance for a wider object [m].
            speed: speed of the opening [m/s].
            force: grasping force [N], up to `config.max_force`.
        """
        wrong = self._wrong(width, speed) or _wrong_tolerance(epsilon_inner, epsilon_outer) or self._wrong_force(force)
        target = 0.0 if width <= self.width else self.max_width
        narrowest, widest = width - epsilon_inner, width + epsilon_outer

        def judge(_: bool) -> str:
            if not narrowest < self.width < widest:
                return f"the fingers are at {self.width:.4f} m; expected between {narrowest:.4f} and {widest:.4f} m"
            self._hold = (target, min(speed, self.config.max_speed), narrowest, widest)
            self.is_grasped, self.force = True, force
            return ""

        return self._begin("grasp", wrong, [(target, speed)], judge)

    def stop(self) -> HandMotion:
        """End any motion or grasp; the fingers then rest without pressing."""
        motion = self._begin("stop", "", [], self._unblocked)
        self._task = None
        motion.end(HandOutcome.SUCCESS)
        return motion

    def step(self, dt: float) -> None:
        """Advance the running motion or grasp by dt [s]."""
        if self._task is not None:
            self._carry_out(self._task, dt)
        elif self._hold is not None:
            target, speed, narrowest, widest = self._hold
            self._approach(target, speed * dt)
            self.is_grasped = narrowest < self.width < widest

    def advance(self, time: float) -> None:
        """Advance to robot time `time` [s]; the first call, and one after a jump back in time, only set the clock."""
        before, self._time = self._time, time
        if before is not None and time > before:
            self.step(time - before)

    def _begin(
        self, name: str, wrong: str, legs: list[tuple[float, float]], judge: Callable[[bool], str]
    ) -> HandMotion:
        """Start a requested motion and return it; an invalid request (`wrong` has the reason) fails without effect."""
        motion = HandMotion(name)
        if wrong:
            motion.end(HandOutcome.FAIL, wrong)
            return motion
        if self._task is not None:
            self._task.motion.end(HandOutcome.ABORTED, f"ended by a new request: {name}")
        self._task = _Task(motion, [(target, min(speed, self.config.max_speed)) for target, speed in legs], judge)
        self._hold, self.is_grasped, self.force = None, False, 0.0
        return motion

    def _carry_out(self, task: _Task, dt: float) -> None:
        target, speed = task.legs[0]
        blocked = self._approach(target, speed * dt)
        if self.width == target:
            task.legs.pop(0)
        if blocked or not task.legs:
            self._task = None
            reason = task.judge(blocked)
            task.motion.end(HandOutcome.UNSUCCESSFUL if reason else HandOutcome.SUCCESS, reason)

    def _approach(self, target: float, distance: float) -> bool:
        """Move the fingers by a distance [m] towards an opening [m]; return True if an object blocks them."""
        if target >= self.width:
            self.width = min(target, self.width + distance)
            return False
        stop = target if self._object is None else max(target, min(self._object, self.width))
        self.width = max(stop, self.width - distance)
        return self.width == stop > target

    def _unblocked(self, blocked: bool) -> str:
        return f"an object stopped the fingers at {self.width:.4f} m" if blocked else ""

    def _wrong(self, width: float, speed: float) -> str:
        if not 0.0 <= width <= self.max_width:  # NaN fails as well
            return f"width {width} m; valid: 0 to {self.max_width:g} m"
        if not (speed > 0.0 and math.isfinite(speed)):
            return f"speed {speed} m/s; valid: above 0"
        return ""

    def _wrong_force(self, force: float) -> str:
        maximum = self.config.max_force
        return "" if 0.0 <= force <= maximum else f"force {force} N; valid: 0 to {maximum:g} N"


def _wrong_tolerance(inner: float, outer: float) -> str:
    if inner >= 0.0 and outer >= 0.0 and math.isfinite(inner) and math.isfinite(outer):
        return ""
    return f"tolerances {inner} and {outer} m; valid: finite, not below 0"


@cache
def defaults() -> HandConfig:
    """Return the default parameters of the emulated hand, from config/hand.yaml."""
    return HandConfig.of(package_yaml(__file__, "hand"), "franka_sim/config/hand.yaml:")


def emulated_hand(node: Node) -> tuple[Gripper, Callable[[], None]]:
    """Create an emulated hand and its live ROS parameter `object_width`.

    Returns:
        (hand, function that unregisters the parameter).
    """
    hand = Gripper()
    parameter = LiveParameter(
        "object_width", 0.0, 0.0, hand.max_width, "width of what lies between the fingers [m]; 0: nothing"
    )

    def change(values: ParameterValues) -> ParameterValues:
        hand.object_width = values["object_width"] or None
        return values

    return hand, node.live_parameters([parameter], change).unregister
