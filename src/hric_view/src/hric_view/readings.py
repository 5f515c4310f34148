"""Values that the page shows next to the scene: efforts, near limits, EMG, setpoint, pace, supervisor's decision."""

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
"""Names of the controllers whose topic `state` has the commanded joint positions."""

PACE_PERIOD = 0.5
"""Time over which the pace of a simulation is measured, and after which it is sent again [s of wall time]; project
default."""
VALUES, UNKNOWN = ("position", "velocity", "effort"), (math.nan, math.nan, math.nan)
"""Names of the values of a joint state, and the values of a joint of which no state was received."""


class LiveLimits:
    """Efforts of the arm's joints, and warnings of joints near their limits; thread-safe.

    Args:
        names: joints in the order of the frame.
        limits: limits by the name of the joint.
    """

    def __init__(self, names: Sequence[str], limits: Mapping[str, JointLimits]) -> None:
        self._names, self._limits = names, limits
        self._joints = NewestJoints(names)
        self.push = self._joints.push

    def scene(self) -> dict[str, object]:
        """Return an empty dictionary: a new viewer needs nothing before the first frame, which has the values."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return the effort of each joint [N m] (null: not known), and a warning for each joint that has one.

        A warning is a level (0: values not known, 1: near a limit, 2: at a limit) and a text, by joint.
        """
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
        """Return level and text of the warning of a joint; text "": there is none.

        Args:
            name: name of the joint.
            state: position, velocity and effort of the joint; NaN: not known.
        """
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
        """Return an empty dictionary: each frame has the channels, since they may appear later."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return the mean envelope by channel, as share of the MVC [1] or in the channel's unit; null: not known."""
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
        """Return the commanded positions [rad] in the order of the frame; null: the joint is not commanded."""
        if (message := self.get()) is None:
            return {}
        desired = dict(zip(message.joint_names, message.desired.positions, strict=False))
        positions = [known(desired.get(name, math.nan), DIGITS) for name in self._names]
        return {} if set(positions) == {None} else {"setpoint": positions}


class LivePace(LiveState):
    """Real-time factor of a simulation, from hric_msgs/ClockPair; below 1, it makes LiveState.patience longer."""

    def __init__(self) -> None:
        super().__init__()
        self._since, self._reported = (-math.inf, 0.0), -math.inf
        self._achieved: float | None = None

    def push(self, message: Any) -> None:
        """Store a pair of robot time and monotonic time of the machine; a pair from a real arm is ignored."""
        if not message.scheduled and message.real_time_factor:
            return
        super().push(message)
        LiveState.patience = LOST / min(message.real_time_factor or 1.0, 1.0)
        at, run = 1e-9 * message.monotonic, message.run_time.to_sec()
        if (passed := at - self._since[0]) >= PACE_PERIOD:
            self._achieved = round((run - self._since[1]) / passed, 2) if passed < 2.0 * PACE_PERIOD else None
            self._since = at, run

    def frame(self) -> dict[str, object]:
        """Return real-time factors each PACE_PERIOD: requested (0: as fast as possible), achieved (null: not known)."""
        now, message = time.monotonic(), self.get()
        if now - self._reported < PACE_PERIOD:
            return {}
        self._reported = now
        known = message and {"requested": message.real_time_factor, "achieved": self._achieved}
        return {"pace": known}


class LiveSafety(LiveState):
    """Newest decision of a supervisor (hric_msgs/SafetyState)."""

    def frame(self) -> dict[str, object]:
        """Return the decision: state, reason, speed scale [1], distances [m] and nearest points, x, y, z [m].

        `separation` is the distance of arm and person, `protective` the protective separation distance; null: not
        known.
        """
        if (message := self.get()) is None:
            return {}
        points = [[known(v, 4) for v in (p.x, p.y, p.z)] for p in (message.robot_point, message.person_point)]
        distances = {name: known(getattr(message, name), 3) for name in ("separation", "protective", "scale")}
        reason = message.fault or message.reason
        return {"safety": {"state": message.state, "reason": reason, "points": points, **distances}}


def known(value: float, digits: int) -> float | None:
    """Return a value rounded to a number of decimals; None: it is not finite."""
    return round(value, digits) if math.isfinite(value) else None
