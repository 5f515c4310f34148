"""Readings beside the scene: efforts, limits that are near, EMG, setpoint, and the supervisor's decision. No node."""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

from hric_control.limits import JointLimits
from hric_perception.view.decimation import MeanChunk, NewestJoints
from hric_perception.view.limit_markers import of_joint
from hric_view.live import DIGITS
from hric_view.parts import FORCE_DIGITS, LOST, LiveState

SETPOINTS = ("joint_pd_controller", "effort_joint_trajectory_controller", "position_joint_trajectory_controller")
"""Controllers whose topic `state` has the commanded joint positions."""

PACE_PERIOD = 0.5
"""Time over which the pace of a simulation is measured, and after which viewers learn it again [s of wall time]."""
VALUES, UNKNOWN = ("position", "velocity", "effort"), (math.nan, math.nan, math.nan)
"""State of a joint: names of its values, and the values of a joint that is silent."""


class LiveLimits:
    """Efforts of the arm's joints, and how near they are to their limits; thread-safe.

    Args:
        names: joints in the order of the frame.
        limits: limits by the name of the joint.
    """

    def __init__(self, names: Sequence[str], limits: Mapping[str, JointLimits]) -> None:
        self._names, self._limits = names, limits
        self._joints = NewestJoints(names)
        self.push = self._joints.push

    def scene(self) -> dict[str, object]:
        """Return nothing: all values are in the frames."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return efforts [N m], null: not known; by joint level (1: near a limit, 2: at it) and text."""
        if (message := self._joints.take()) is None:
            return {}
        states = dict(
            zip(message.name, zip(message.position, message.velocity, message.effort, strict=True), strict=True)
        )
        efforts = [states[name][2] if name in states else math.nan for name in self._names]
        return {
            "efforts": [known(value, FORCE_DIGITS) for value in efforts],
            "near": {name: near for name in self._limits if (near := self._near(name, states.get(name, UNKNOWN)))[1]},
        }

    def _near(self, name: str, state: tuple[float, float, float]) -> tuple[int, str]:
        """Return the level and the text of a joint: limits that are near, and values that are not known."""
        near = of_joint(self._limits[name], *state)
        unknown = [what for what, value in zip(VALUES, state, strict=True) if math.isnan(value)]
        texts = [near.text] * bool(near.text) + [f"{' and '.join(unknown)} not known"] * bool(unknown)
        return int(near.level), "; ".join(texts)


class LiveEmg:
    """Mean of the EMG envelope since the last frame, by channel; thread-safe.

    Args:
        rate: rate of the frames [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._mean = MeanChunk(rate)
        self.push = self._mean.push

    def scene(self) -> dict[str, object]:
        """Return nothing: channels may appear later."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return the envelope, in shares of the maximum contraction or in the unit of the channel; null: not known."""
        message = self._mean.take()
        if message is None:
            return {}
        values = [None if math.isnan(value) else float(f"{value:.4g}") for value in message.data]
        return {"emg": dict(zip(message.channels, values, strict=True))}


class LiveSetpoint(LiveState):
    """Commanded joint positions, from the control_msgs/JointTrajectoryControllerState of the running controller.

    Args:
        names: joints in the order of the frame.
    """

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__()
        self._names = names

    def frame(self) -> dict[str, object]:
        """Return the positions [rad], null: this joint is not commanded."""
        if (message := self.get()) is None:
            return {}
        desired = dict(zip(message.joint_names, message.desired.positions, strict=False))
        positions = [known(desired.get(name, math.nan), DIGITS) for name in self._names]
        return {} if set(positions) == {None} else {"setpoint": positions}


class LivePace(LiveState):
    """Pace of a simulation, from hric_msgs/ClockPair; while it is below real time, all LiveState wait longer."""

    def __init__(self) -> None:
        super().__init__()
        self._since, self._reported = (-math.inf, 0.0), -math.inf
        self._achieved: float | None = None

    def push(self, message: Any) -> None:
        """Store a pair of the robot's time and that of its machine; a real arm, whose pace is its own, is left out."""
        if not message.scheduled and message.real_time_factor:
            return
        super().push(message)
        LiveState.patience = LOST / min(message.real_time_factor or 1.0, 1.0)
        at, run = 1e-9 * message.monotonic, message.run_time.to_sec()
        if (passed := at - self._since[0]) >= PACE_PERIOD:
            self._achieved = round((run - self._since[1]) / passed, 2) if passed < 2.0 * PACE_PERIOD else None
            self._since = at, run

    def frame(self) -> dict[str, object]:
        """Return requested pace, 0: as fast as possible, and achieved one, null: not known, every PACE_PERIOD."""
        now, message = time.monotonic(), self.get()
        if now - self._reported < PACE_PERIOD:
            return {}
        self._reported = now
        known = message and {"requested": message.real_time_factor, "achieved": self._achieved}
        return {"pace": known}


class LiveSafety(LiveState):
    """Newest decision of a supervisor (hric_msgs/SafetyState)."""

    def frame(self) -> dict[str, object]:
        """Return state, reason, distance and protective distance [m], null: not known, and the nearest points [m]."""
        if (message := self.get()) is None:
            return {}
        points = [[known(v, 4) for v in (p.x, p.y, p.z)] for p in (message.robot_point, message.person_point)]
        distances = {name: known(getattr(message, name), 3) for name in ("separation", "protective", "scale")}
        reason = message.fault or message.reason
        return {"safety": {"state": message.state, "reason": reason, "points": points, **distances}}


def known(value: float, digits: int) -> float | None:
    """Return a value, rounded; None: it is not finite."""
    return round(value, digits) if math.isfinite(value) else None
