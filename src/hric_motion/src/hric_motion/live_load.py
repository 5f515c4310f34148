"""Live muscle load of a real person's arms, from tracker frames and the measured force on a hand.

    live = LiveLoad(body, anatomy, "right")
    live.add(estimate), live.add_force(force)          # as they arrive
    live.take()                                        # load at the instants for which all data have arrived

At equally spaced instants, least-squares cubics through the surrounding frames give joint angles, root pose and their
first two derivatives (Savitzky & Golay, Anal. Chem. 36:1627, 1964, but frames may be unevenly spaced); the load is
therefore delayed by half a window. `AfterRun` computes the muscle load from them. The result does not depend on how the
data are divided among calls.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose, Vector, transformed
from hric_human.body import Body
from hric_human.control.kinematics import GRAVITY, HandChain
from hric_human.control.whole_body import ExternalLoad, RootMotion
from hric_human.muscles.after_run import RATE, AfterRun, MuscleLoad, RecordedMotion, of_root_too
from hric_human.muscles.anatomy import BUILT_IN, Anatomy, load
from hric_human.muscles.muscle_set import MuscleSet
from hric_motion.tracking import BRIDGED, LOST, MEASURED, PersonEstimate

WINDOW = 0.125
"""Half-width of the time window around an instant [s]. Constants of this file are project defaults, unconfirmed."""
DEGREE = 3
"""Degree of the polynomials fitted to the frames in a window."""
FEWEST = 6
"""Minimum number of tracker frames in a window; with fewer the load is not computed."""
GAP = 0.1
"""Maximum time between two tracker frames, and between two samples of the force [s]; a longer gap counts as missing."""
PATIENCE = 0.3
"""Time [s] for which an instant waits for samples of the hand force after its tracker frames have arrived."""
REACH = 0.5
"""Distance [m] from the hand's centre of mass; a force that acts farther away is not counted as on the hand."""
ANOTHER_CLOCK = 3600.0
"""Step of time between frames [s] from which on the clock is assumed to have changed."""
STAMP = 1e-6
"""Tolerance for rounding errors of times [s]."""
UNMEASURED, MISSING, AWAY = "none", "missing", "away"
"""States of the hand force other than MEASURED: no sensor; no sample at this time; too far from the hand to count."""
_ORDER = (MEASURED, BRIDGED, LOST)


class HandForce(NamedTuple):
    """Measured force and torque on a hand, in the motion capture frame.

    Attributes:
        time: time of the sample [s].
        force: force on the hand [N].
        torque: torque on the hand, about `point` [N m].
        point: point at which the force acts [m].
    """

    time: float
    force: Vector
    torque: Vector
    point: Vector


@dataclass(frozen=True)
class PersonLoad:
    """Muscle load of a real person at n instants, with the quality of the underlying measurements.

    Attributes:
        load: load of the muscles. NaN: all values of an arm whose motion or force is lost; muscle values of an arm
            outside the range of the fitted muscle paths.
        states: MEASURED, BRIDGED (interpolated over a gap) or LOST, by side: the worst tracking state in the window, of
            all joints from the root to the hand; LOST also while the force on the hand is MISSING.
        force: state of the hand force at each instant: UNMEASURED, MEASURED, MISSING or AWAY.
        acting: load on the hand as used in the computation; zero while it is AWAY, NaN while it is MISSING.
        distance: distance between the hand and the point at which the force acts, shape (n,) [m]; NaN without a force.
    """

    load: MuscleLoad
    states: Mapping[str, tuple[str, ...]]
    force: tuple[str, ...]
    acting: ExternalLoad
    distance: FloatArray


class _Frame(NamedTuple):
    """Tracker frame: joint positions, root position and quaternion; tracking states as indices of _ORDER."""

    time: float
    values: FloatArray
    states: NDArray[np.int8]


class LiveLoad:
    """Live computation of one person's muscle load; called from one thread.

    Args:
        body: body of the person, with arms.
        anatomy: anatomy of the muscles; None: the built-in one.
        hand: "right" or "left", on which the measured force acts; None: no force is measured.
        strength: factor on the muscles' strength [1].
        gravity: gravity vector in axes of the motion capture frame [m/s^2].

    Attributes:
        names: names of muscles and actuators.
        joints: names of the joints that muscles and actuators move.
        links: links on which the joint contact forces act, by joint centre.

    Raises:
        HricError: the body has no such hand.
    """

    def __init__(
        self, body: Body, anatomy: Anatomy | None, hand: str | None, strength: float = 1.0, gravity: Vector = GRAVITY
    ) -> None:
        sides = [side for side in ("right", "left") if f"{side}_hand" in body.segments]
        if hand is not None and hand not in sides:
            raise HricError(f"the body of {body.subject.code} has no {hand} hand; valid: {', '.join(sides) or 'none'}")
        anatomy = anatomy or load(BUILT_IN)
        self._after = AfterRun(body, MuscleSet(body, anatomy, strength), anatomy, Pose(), gravity)
        self.names, self.joints, self.links = self._after.names, self._after.joints, self._after.links
        self._chains = {side: HandChain(body, side) for side in sides}
        self._count, self._hand = len(body.joints), hand
        self._link = body.segments[f"{hand or sides[0]}_hand"].link
        self.restart()

    def restart(self) -> None:
        """Discard all frames and forces received so far."""
        self._frames: deque[_Frame] = deque()
        self._forces: deque[HandForce] = deque()
        self._next: int | None = None

    def add(self, estimate: PersonEstimate) -> None:
        """Add a tracker frame; one that is older than the last, or an hour newer, restarts the computation."""
        if self._frames and not 0.0 < estimate.time - self._frames[-1].time < ANOTHER_CLOCK:
            self.restart()
        orientation = np.array(estimate.root.orientation)
        if self._frames and orientation @ self._frames[-1].values[-4:] < 0.0:
            orientation = -orientation  # the same rotation, but without a jump in the fitted values
        states = np.array([_ORDER.index(state) for state in (*estimate.states, estimate.root_state)], np.int8)
        values = np.concatenate([estimate.q, estimate.root.position, orientation])
        self._frames.append(_Frame(estimate.time, values, states))
        if self._next is None:
            self._next = math.ceil((estimate.time + WINDOW - STAMP) * RATE)

    def add_force(self, force: HandForce) -> None:
        """Add a sample of the hand force; ignore one that is not finite, and discard all earlier if time jumps back."""
        if not all(map(math.isfinite, (*force.force, *force.torque, *force.point))):
            return
        if self._forces and force.time <= self._forces[-1].time:
            self._forces.clear()
        self._forces.append(force)

    def take(self) -> PersonLoad | None:
        """Return the load at all instants whose data have become complete since the last call; None without any."""
        instants = self._due()
        if not instants:
            return None
        frames = _Fitted(self._frames)
        fitted = [frame for frame in (frames.at(instant / RATE) for instant in instants) if frame is not None]
        result = self._of(fitted) if fitted else None
        self._forget()
        return result

    def _due(self) -> list[int]:
        """Return the indices of instants whose window has passed, and whose force has arrived or timed out."""
        if self._next is None:
            return []
        newest, first = self._frames[-1].time - WINDOW + STAMP, self._next
        if self._hand is not None and not (self._forces and self._forces[-1].time >= newest):
            newest = max(newest - PATIENCE, min(newest, self._forces[-1].time if self._forces else -math.inf))
        self._next = max(first, math.floor(newest * RATE) + 1)
        return list(range(first, self._next))

    def _forget(self) -> None:
        """Remove frames and forces that no future window needs."""
        assert self._next is not None
        time = self._next / RATE
        while self._frames[0].time < time - WINDOW - GAP and len(self._frames) > 1:
            self._frames.popleft()
        while len(self._forces) > 1 and self._forces[1].time < time:
            self._forces.popleft()

    def _of(self, instants: "list[_Instant]") -> PersonLoad:
        time = np.array([instant.time for instant in instants])
        derivatives = np.array([instant.derivatives for instant in instants])
        motion, root = of_root_too(RecordedMotion(time, *derivatives.swapaxes(0, 1)), self._count)
        force, acting, distance = self._acting(time, motion, root)
        known = acting._replace(force=np.nan_to_num(acting.force), torque=np.nan_to_num(acting.torque))
        worst = np.array([instant.states for instant in instants])
        states = {side: self._state(side, worst, force) for side in self._chains}
        lost = {side: np.array(state) == LOST for side, state in states.items()}
        return PersonLoad(_trusted(self._after.of(motion, [known], root), lost), states, force, acting, distance)

    def _state(self, side: str, worst: NDArray[np.int8], force: tuple[str, ...]) -> tuple[str, ...]:
        """Return the state of an arm at n instants; worst: worst state of each joint and of the root in the window."""
        rows = worst[:, [*self._chains[side].joints, self._count]].max(axis=1)
        unknown = np.array(force) == MISSING if side == self._hand else np.zeros(len(rows), np.bool_)
        return tuple(LOST if gone else _ORDER[row] for row, gone in zip(rows.tolist(), unknown, strict=True))

    def _acting(
        self, time: FloatArray, motion: RecordedMotion, root: RootMotion
    ) -> tuple[tuple[str, ...], ExternalLoad, FloatArray]:
        """Return at n instants the state of the force, the load on the hand, and the distance of force and hand [m]."""
        n, nothing = len(time), np.zeros((len(time), 3))
        if self._hand is None:
            return (UNMEASURED,) * n, ExternalLoad(self._link, nothing, nothing, nothing), np.full(n, np.nan)
        values, known = _between(self._forces, time)
        force, torque, point = values.reshape(n, 3, 3).swapaxes(0, 1)
        chain = self._chains[self._hand]
        poses = map(Pose, map(tuple, root.position.tolist()), map(tuple, root.orientation.tolist()))
        hand = [transformed(pose, chain.pose(q).position) for pose, q in zip(poses, motion.q.tolist(), strict=True)]
        distance = np.linalg.norm(point - hand, axis=1)
        away = known & (distance > REACH)
        states = np.where(away, AWAY, np.where(known, MEASURED, MISSING))
        force, torque = (np.where(away[:, None], 0.0, vector) for vector in (force, torque))
        return tuple(states.tolist()), ExternalLoad(self._link, force, torque, np.nan_to_num(point)), distance


class _Instant(NamedTuple):
    """Values at an instant of the cubics that were fitted to the tracker frames in a window around it.

    Attributes:
        time: time of the instant [s].
        derivatives: joint positions and root pose (order of `_Frame`), their first and second time derivatives, shape
            (3, values).
        states: worst tracking state within the window (0 measured, 1 bridged, 2 lost) of each joint, then of the root.
    """

    time: float
    derivatives: FloatArray
    states: NDArray[np.int8]


class _Fitted:
    """Least-squares cubics through tracker frames."""

    def __init__(self, frames: deque[_Frame]) -> None:
        self._time = np.array([frame.time for frame in frames])
        self._values, self._states = (np.array([frame[part] for frame in frames]) for part in (1, 2))

    def at(self, time: float) -> _Instant | None:
        """Return the fit at a time [s]; None if there are too few frames around it."""
        first, last = np.searchsorted(self._time, (time - WINDOW - STAMP, time + WINDOW + STAMP))
        since = self._time[first:last] - time
        edges = np.concatenate([[-WINDOW], since, [WINDOW]])
        if last - first < FEWEST or np.diff(edges).max() > GAP:
            return None
        powers = np.vander(since / WINDOW, DEGREE + 1, increasing=True)
        coefficients = np.linalg.lstsq(powers, self._values[first:last], rcond=None)[0]
        scale = np.array([1.0, 1.0 / WINDOW, 2.0 / WINDOW**2])
        return _Instant(time, scale[:, None] * coefficients[:3], self._states[first:last].max(axis=0))


def _between(forces: deque[HandForce], time: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Interpolate force, torque and point linearly at n instants.

    Returns:
        values, shape (n, 9), NaN where samples are too far apart or missing; and True for instants with values.
    """
    if len(forces) < 2:
        return np.full((len(time), 9), np.nan), np.zeros(len(time), np.bool_)
    sampled = np.array([force.time for force in forces])
    rows = np.array([[*force.force, *force.torque, *force.point] for force in forces])
    after = np.searchsorted(sampled, time).clip(1, len(sampled) - 1)
    inside = (time >= sampled[0] - STAMP) & (time <= sampled[-1] + STAMP)
    known = inside & (sampled[after] - sampled[after - 1] <= GAP)
    values = np.stack([np.interp(time, sampled, column) for column in rows.T], axis=1)
    return np.where(known[:, None], values, np.nan), known


def _trusted(load: MuscleLoad, lost: Mapping[str, NDArray[np.bool_]]) -> MuscleLoad:
    """Return the load with NaN for values that are not known; lost: True for lost instants, by side, shape (n,)."""
    load = replace(load, lost=lost)
    gone = np.stack([lost[name.partition("_")[0]] for name in load.joints], axis=1)
    muscles, joints = (np.stack([load.known(name) for name in names], axis=1) for names in (load.names, load.joints))
    return replace(
        load,
        activation=np.where(muscles, load.activation, np.nan),
        force=np.where(muscles, load.force, np.nan),
        torque=np.where(gone, np.nan, load.torque),
        share=np.where(gone, np.nan, load.share),
        shortfall=np.where(joints, load.shortfall, np.nan),
        contact={name: np.where(load.known(name)[:, None], force, np.nan) for name, force in load.contact.items()},
    )
