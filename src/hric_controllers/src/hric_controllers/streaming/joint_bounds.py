"""Bounds of the joints for a stream of poses, of which the control box computes the joint motion. No ROS.

The inverse kinematics of the emulated control box predicts the joint motion. Of each step, as much is commanded as the
joints allow, so the end effector slows down and stays on its path. It slows down early, by the joint motion that its
present velocity would need in the next `HORIZON` seconds.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import FrankaLimits
from franka_hw_interface.robot_state import RobotState
from franka_hw_interface.transforms import from_column_major
from franka_sim.box.config import BoxConfig, motion_parameters
from franka_sim.box.inverse_kinematics import ELBOW_JOINT, ElbowInverseKinematics
from franka_sim.box.kinematics import moved, twist_between
from franka_sim.box.self_collision import SelfCollision
from hric_control.limits import load_limits
from hric_core.node import Node

HORIZON, SAMPLES = 0.25, 5
"""Time for which the joint motion is predicted [s], and number of its samples (project default)."""
EACH, EACH_CLEARANCE = 4, 16
"""Cycles from one prediction to the next, and from one of the distances between links to the next (project default)."""
SLOWING = 12.0
"""Largest relative deceleration before a limit [1/s] (project default)."""
PRUDENT = 0.7
"""Share of the limits at which the predicted motion is slowed down (project default)."""
ALLOWED = 0.9
"""Share of the velocity limits that is used at most (project default)."""
GENTLE = 0.6
"""Share of the limits of acceleration and jerk that is used at most (project default).

The box bridges a lost packet with the acceleration before it; the next command then changes it by up to twice that."""
TOLERANCE = 1.02
"""Factor on this share for steps whose joint motion was computed by a linear rule (project default)."""
MARGIN = 0.05
"""Distance from the end of a position range at which a joint stops [rad].

An FR3 lets no joint come closer than 0.008 rad (velocity_offset and deceleration_limit in limits_fr3.yaml)."""
BRAKING = 2.0
"""Deceleration towards the end of a position range [rad/s^2], below the least of an FR3 (2.585, limits_fr3.yaml)."""
SINGULAR = 25.0
"""Joint velocity per velocity of the end effector [1/m] from which a pose counts as singular (project default)."""
CLEARANCE = 0.03
"""Distance of two links from each other at which the end effector stops [m]; the emulated box stops at 0.005 m."""
SLOWEST = 0.02
"""Least velocity with which the joint motion is predicted [m/s] (project default)."""
LEVER = 0.3
"""Length by which rotations are compared with translations [m] (project default)."""
CORRECTION = 0.02
"""Share of the difference from the self-motion of the box that is corrected in each cycle (project default)."""
EXACT = 1e-6
"""Difference [m], [1], [rad] up to which the box has the commanded pose; an FR3 sends single precision."""
BRAKES = (0.2, 0.5, 1.0)
"""Shares of the largest deceleration of the joints that are tried in braking (project default)."""


OVER = 5.0
"""Time without a reason after which it counts as a new occurrence [s] (project default)."""


class _Step(NamedTuple):
    """Step of one cycle: pose, twist and joint positions, and the largest of its ratios to a limit."""

    T: list[float]
    twist: list[float]
    q: list[float]
    ratio: float


class JointBounds:
    """Joint motion behind the poses of a stream, within the limits of the joints.

    Args:
        model: model of the arm; `start` sets its end effector.
        limits: limits of the arm.
        filtered: True if poses are filtered on their way to the arm.
        period: control period [s].

    Attributes:
        share: share of the step to the last pose that was possible, 0 to 1.
        reason: why the end effector must be slower; empty if it need not.
    """

    def __init__(self, model: KdlFrankaModel, limits: FrankaLimits, filtered: bool, period: float = 1e-3) -> None:
        bounds = limits.with_margins()
        self._model, self._period, self._names, self._limits = model, period, model.joint_names, limits
        self._dt, self._filtered = period, filtered
        self._ik = ElbowInverseKinematics(model, motion_parameters(), period)
        self._lower, self._upper = [x + MARGIN for x in limits.lower], [x - MARGIN for x in limits.upper]
        config = BoxConfig()
        self._itself, self._reach = SelfCollision(model, config), config.reach
        self._velocity, self._acceleration = bounds.velocity, bounds.acceleration
        self._accelerations = [GENTLE * a for a in bounds.acceleration]
        self._space = [GENTLE * x.acceleration for x in (limits.translation, limits.rotation)]
        self._jerk = [GENTLE * x.jerk for x in (limits.translation, limits.rotation)]
        self.share, self.reason = 1.0, ""

    @classmethod
    def of_arm(cls, root_node: Node, arm_id: str, arm: FrankaPoseCartesianInterface) -> Self:
        """Return the bounds of an arm: its limits, and those of the robot description where they are lower."""
        description = root_node.search_param("robot_description")
        model = KdlFrankaModel(description, arm_id)
        joints = load_limits(description, root_node, model.joint_names, use=("position", "velocity"))
        return cls(model, arm.limits.within(joints), arm.filtered)

    def start(self, state: RobotState) -> None:
        """Start at rest at the desired pose and joint positions of the arm's state."""
        q = list(state.q_d)
        self._model.set_ee(from_column_major(state.F_T_EE))
        self._ik.begin(q)
        self._room, self._checked, self._clear = self._itself.clearance(q), q, 1.0
        self._hold, self._last = q[ELBOW_JOINT], _Step(list(state.O_T_EE_c), [0.0] * 6, q, 0.0)
        self._dq, self._before, self._change = [0.0] * 7, [0.0] * 7, [0.0] * 6
        self._predicted, self._cycle = 1.0, 0
        self.share, self.reason = 1.0, ""

    def advance(self, T: list[float], state: RobotState, period: float) -> list[float]:
        """Return the pose to command, 16 floats, column-major: T, or the part of the step to it that is possible.

        Args:
            T: pose of the next cycle.
            state: present state of the arm, with the desired motion of the box after the pose before.
            period: time since the last cycle [s]; longer than the control period after a lost packet.
        """
        bridged = self._correct(state)
        self._dt = self._period if bridged else max(period, self._period)
        self._now, self._largest = self._caps(), [a * self._dt for a in self._accelerations]
        twist = twist_between(self._last.T, T, self._dt)
        if self._cycle % EACH == 0:
            self._predicted = self._predict(twist)
        self._cycle += 1
        best = None
        for share, step in self._candidates(T, twist):
            if step is not None and (best is None or step.ratio < best.ratio):
                self.share, best = share, step
                if step.ratio <= TOLERANCE:
                    break
        if best is None:  # the box has no joint motion, not even for the present pose
            self.share, best = 0.0, self._last._replace(twist=[0.0] * 6)
        self._before, self._dq = self._dq, self._rates(best.q)
        self._change = [v - last for v, last in zip(best.twist, self._last.twist, strict=True)]
        self._last = best
        return best.T

    def _candidates(self, T: list[float], twist: list[float]) -> Iterator[tuple[float, _Step | None]]:
        """Yield (share, step): the whole step, the largest part that is possible, and ways to brake."""
        whole = self._step(T, twist)
        if self._predicted == 1.0:
            yield 1.0, whole
        rest = self._step(self._last.T, [0.0] * 6)
        if whole is not None and rest is not None:
            low, high = self._range(self._rates(rest.q), self._rates(whole.q), twist)
            if low <= high:
                share = max(low, min(high, self._slower(twist)))
                yield share, self._moved([share * x for x in twist])
        largest = min(1.0, *(step / max(abs(v), 1e-12) for step, v in zip(self._largest, self._dq, strict=True)))
        for part in BRAKES:
            left = (1.0 - part * largest) * self._dt
            pose = self._ik.kinematics.pose([x + left * v for x, v in zip(self._last.q, self._dq, strict=True)])
            yield 0.0, self._step(pose, twist_between(self._last.T, pose, self._dt))
        yield 0.0, self._moved([(1.0 - SLOWING * self._dt) * x for x in self._last.twist])
        yield 0.0, rest

    def _moved(self, twist: list[float]) -> _Step | None:
        return self._step(moved(self._last.T, twist, self._dt), twist)

    def _step(self, T: list[float], twist: list[float]) -> _Step | None:
        """Return the step to a pose as the box makes it; None if the box has no joint motion to it."""
        rows = zip(self._last.q, self._dq, self._before, strict=True)
        guess = [x + (2.0 * v - w) * self._dt for x, v, w in rows]
        q = self._ik.follow(T, self._hold, self._last.q, guess, self._dq)
        if q is None:
            return None
        ratio = 0.0
        for v, last, step, (down, up) in zip(self._rates(q), self._dq, self._largest, self._now, strict=True):
            excess = max(v - max(up, last - step), min(down, last + step) - v)
            ratio = max(ratio, abs(v - last) / step, 1.0 + excess / step if excess > 1e-9 else 0.0)
        dt = self._dt
        change = [v - last for v, last in zip(twist, self._last.twist, strict=True)]
        for k, largest, jerk in zip((0, 3), self._space, self._jerk, strict=True):
            now, before = change[k : k + 3], self._change[k : k + 3]
            ratio = max(ratio, math.hypot(*now) / (largest * dt), math.dist(now, before) / (jerk * dt * dt))
        return _Step(T, twist, q, ratio)

    def _rates(self, q: Sequence[float]) -> list[float]:
        return [(x - last) / self._dt for x, last in zip(q, self._last.q, strict=True)]

    def _correct(self, state: RobotState) -> bool:
        """Continue from the motion of the control box if it differs; return True if the box bridged a lost packet.

        If the box gets the poses unfiltered, its pose differs only after a lost packet, which it bridges. After
        libfranka's filter the pose always differs, and its rate limiter takes care of lost packets. The box may also
        choose another joint position for the same pose.
        """
        last, null = self._last, self._ik.null
        other = max(abs(x - y) for x, y in zip(state.O_T_EE_c, last.T, strict=True)) > EXACT
        if other and not self._filtered:
            self._last = _Step(list(state.O_T_EE_c), list(state.O_dP_EE_c), list(state.q_d), 0.0)
            self._dq = list(state.dq_d)
            self._before = [v - a * self._dt for v, a in zip(state.dq_d, state.ddq_d, strict=True)]
            self._change = [a * self._dt for a in state.O_ddP_EE_c]
            return True
        offset = sum(n * (x - y) for n, x, y in zip(null, state.q_d, last.q, strict=True))
        if abs(offset) > EXACT:
            self._last = last._replace(q=[x + CORRECTION * offset * n for x, n in zip(last.q, null, strict=True)])
        return False

    def _caps(self) -> list[tuple[float, float]]:
        """Return the least and the largest velocity of each joint [rad/s], by its limits of velocity and position."""
        caps = []
        for x, v, low, high in zip(self._last.q, self._velocity, self._lower, self._upper, strict=True):
            down, up = (math.sqrt(2.0 * BRAKING * max(0.0, room)) for room in (x - low, high - x))
            caps.append((-min(ALLOWED * v, down), min(ALLOWED * v, up)))
        return caps

    def _predict(self, twist: Sequence[float]) -> float:
        """Return the share of the velocity at which no joint meets a limit within `HORIZON`, 0 to 1."""
        speed = _speed(twist)
        if speed == 0.0:
            self.reason = ""
            return 1.0
        ahead, step = max(speed, SLOWEST), HORIZON / SAMPLES
        twist = [ahead / speed * x for x in twist]
        share, reason, needed = 1.0, "", math.inf
        T, q, rates = self._last.T, self._last.q, self._dq
        for sample in range(SAMPLES):
            T = moved(T, twist, step)
            later = self._ik.solve(T, q[ELBOW_JOINT], [x + step * r for x, r in zip(q, rates, strict=True)])
            nearest = self._ik.nearest(T, q)
            before, needed = needed, math.inf if nearest is None else math.dist(nearest, q) / (ahead * step)
            end = "its path leads out of reach" if later is None else self._end_of_range(later, q)
            if not end and needed > max(SINGULAR, before):
                end = "its path leads to a singular pose"
            if later is None or end:
                share, reason = min((share, reason), (max(0, sample - 1) / SAMPLES, end))
                break
            now = [(x - y) / step for x, y in zip(later, q, strict=True)]
            share, reason = min((share, reason), self._slowest(now, [0.0] * 7 if sample == 0 else rates, sample > 0))
            q, rates = later, now
        share, reason = min((share, reason), (self._apart(q), "parts of the arm would come near each other"))
        share = min(1.0, share * ahead / speed)
        self.reason = reason if share < 1.0 else ""
        return share

    def _apart(self, q: Sequence[float]) -> float:
        """Return the share of the way to predicted joint positions on which the links keep their distance.

        The distance at the last position is computed only if the joints have moved by more than it allows.
        """
        if self._cycle % EACH_CLEARANCE:
            return self._clear
        path = sum(r * abs(x - y) for r, x, y in zip(self._reach, q, self._checked, strict=True))
        self._clear = 1.0
        if path > self._room - CLEARANCE:
            now, then = self._itself.clearance(self._last.q), self._itself.clearance(q)
            self._room, self._checked = now, self._last.q
            if then < min(CLEARANCE, now):
                self._clear = max(0.0, (now - CLEARANCE) / (now - then))
        return self._clear

    def _slowest(self, rates: Sequence[float], before: Sequence[float], accelerated: bool) -> tuple[float, str]:
        """Return the share of the velocity that the joints allow for predicted joint velocities, and the reason."""
        step, share, reason = HORIZON / SAMPLES, 1.0, ""
        for name, r, s, v, a in zip(self._names, rates, before, self._velocity, self._acceleration, strict=True):
            sudden = math.sqrt(PRUDENT * a * step / max(abs(r - s), 1e-9)) if accelerated else 1.0
            slow = min(sudden, PRUDENT * v / max(abs(r), 1e-9))
            if slow < share:
                share, reason = slow, f"{name} would move too fast"
        return share, reason

    def _end_of_range(self, q: Sequence[float], last: Sequence[float]) -> str:
        """Return a text on a joint that moves beyond the end of its range, else an empty one."""
        rows = zip(self._names, q, last, self._lower, self._upper, self._limits.lower, self._limits.upper, strict=True)
        for name, x, y, low, high, lower, upper in rows:
            if (x < low and x < y) or (x > high and x > y):
                return f"{name} is near the end of its range, {lower if x < low else upper:.4g} rad"
        return ""

    def _slower(self, twist: Sequence[float]) -> float:
        """Return the share of a twist with which the end effector is not faster than before, and slower if need be."""
        if self._predicted == 1.0:
            return 1.0
        share = min(1.0, _speed(self._last.twist) / max(_speed(twist), 1e-12))
        return share * (1.0 - (1.0 - self._predicted) * SLOWING * self._dt)

    def _range(self, still: Sequence[float], full: Sequence[float], twist: Sequence[float]) -> tuple[float, float]:
        """Return the least and the largest share of a twist that the limits allow; the least is larger if none is.

        Args:
            still: joint velocities of the box while the pose rests, 7 floats [rad/s].
            full: joint velocities for the twist, 7 floats [rad/s].
            twist: velocity of the end effector, 6 floats [m/s], [rad/s].
        """
        low, high = 0.0, 1.0
        for (down, up), step, last, a, b in zip(self._now, self._largest, self._dq, still, full, strict=True):
            lower, upper = max(min(down, last + step), last - step), min(max(up, last - step), last + step)
            if abs(b - a) > 1e-9:
                ends = sorted(((lower - a) / (b - a), (upper - a) / (b - a)))
                low, high = max(low, ends[0]), min(high, ends[1])
        for k, acceleration in zip((0, 3), self._space, strict=True):
            step = acceleration * self._dt
            v, last_v = twist[k : k + 3], self._last.twist[k : k + 3]
            along, square = sum(x * y for x, y in zip(v, last_v, strict=True)), sum(x * x for x in v)
            rest = along * along - square * (sum(x * x for x in last_v) - step * step)
            if square > 1e-12:
                root = math.sqrt(max(0.0, rest))
                low = max(low, (along - root) / square)
                high = min(high, (along + root) / square if rest >= 0.0 else -1.0)
        return low, high


def _speed(twist: Sequence[float]) -> float:
    return math.hypot(*twist[:3]) + LEVER * math.hypot(*twist[3:])


class Occurrences:
    """Occurrences of reasons; each is new once, until it has been absent for `OVER` seconds."""

    def __init__(self) -> None:
        self._seen: dict[str, float] = {}

    def is_new(self, time: float, reason: str) -> bool:
        """Return True if a reason begins to hold; empty: there is none; `time`: robot time [s]."""
        if not reason:
            return False
        last, self._seen[reason] = self._seen.get(reason, -math.inf), time
        return not 0.0 <= time - last <= OVER
