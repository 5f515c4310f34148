"""Live muscle load of a real person's arms, from tracker frames and the measured force on a hand.

    live = LiveLoad(body, anatomy, "right")
    live.add(estimate), live.add_force(force)          # as they arrive
    live.take()                                        # the load at the instants that have become known

At each instant of an even grid, least-squares cubics through the frames around it give the joints and the root with
their first two derivatives (Savitzky & Golay, Anal. Chem. 36:1627, 1964, for frames that need not be even): the load is
late by half a window. The rest is `AfterRun`. A recording gives the same result, however it is divided.
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
from hric_human.tracking import BRIDGED, LOST, MEASURED, PersonEstimate

WINDOW = 0.125
"""Half of the time window around an instant [s]. The constants of this file are project defaults, unconfirmed."""
DEGREE = 3
"""Degree of the polynomials."""
FEWEST = 6
"""Smallest number of frames in a window with a result."""
GAP = 0.1
"""Largest time between two frames, and between two samples of the force [s]."""
PATIENCE = 0.3
"""Additional time that an instant waits for the force, compared with frames [s]."""
REACH = 0.5
"""Distance from the hand's centre of mass beyond which the force is not on the hand [m]."""
ANOTHER_CLOCK = 3600.0
"""Time between frames from which on they are of different clocks [s]."""
STAMP = 1e-6
"""Differences of times below this are rounding [s]."""
UNMEASURED, MISSING, AWAY = "none", "missing", "away"
"""States of the force other than MEASURED: no sensor; no sample yet; not on the hand, which is then empty."""
_ORDER = (MEASURED, BRIDGED, LOST)


class HandForce(NamedTuple):
    """Load on a hand, in axes of the markers' frame.

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
    """Load of a person's muscles at n instants.

    Attributes:
        load: load of the muscles. NaN: torque, and all that follows from it, of a lost arm; muscle values of an arm
            outside the range of the fitted muscle paths.
        states: MEASURED, BRIDGED or LOST, by side: the worst state in the window of the joints from the root to the
            hand, and LOST while the force on that hand is MISSING.
        force: state of the force: UNMEASURED, MEASURED, MISSING or AWAY.
        acting: load on the hand as used in the computation; zero while it is AWAY, NaN while it is MISSING.
        distance: distance between hand and force, shape (n,) [m]; NaN without a force.
    """

    load: MuscleLoad
    states: Mapping[str, tuple[str, ...]]
    force: tuple[str, ...]
    acting: ExternalLoad
    distance: FloatArray


class _Frame(NamedTuple):
    """Tracker frame: joints, position and orientation of the root, and indices of their states in _ORDER."""

    time: float
    values: FloatArray
    states: NDArray[np.int8]


class LiveLoad:
    """Live load of one person; called from one thread.

    Args:
        body: body of the person, with arms.
        anatomy: anatomy of the muscles; None: the built-in one.
        hand: "right" or "left", on which the measured force acts; None: no force is measured.
        strength: factor of the muscles' strength.
        gravity: gravity vector in axes of the markers' frame [m/s^2].

    Attributes:
        names, joints, links: see `AfterRun`.

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
        muscles = MuscleSet(body, anatomy, strength)
        self._after = AfterRun(body, muscles, anatomy, Pose(), gravity)
        self.names, self.joints, self.links = self._after.names, self._after.joints, self._after.links
        self._chains = {side: HandChain(body, side) for side in sides}
        self._count, self._hand = len(body.joints), hand
        self._link = body.segments[f"{hand or sides[0]}_hand"].link
        self.restart()

    def restart(self) -> None:
        """Discard the history."""
        self._frames: deque[_Frame] = deque()
        self._forces: deque[HandForce] = deque()
        self._next: int | None = None

    def add(self, estimate: PersonEstimate) -> None:
        """Add a frame; one that is not after the last one, or is of another clock, restarts the estimate."""
        if self._frames and not 0.0 < estimate.time - self._frames[-1].time < ANOTHER_CLOCK:
            self.restart()
        orientation = np.array(estimate.root.orientation)
        if self._frames and orientation @ self._frames[-1].values[-4:] < 0.0:
            orientation = -orientation  # the same rotation, and a smooth curve
        states = np.array([_ORDER.index(state) for state in (*estimate.states, estimate.root_state)], np.int8)
        values = np.concatenate([estimate.q, estimate.root.position, orientation])
        self._frames.append(_Frame(estimate.time, values, states))
        if self._next is None:
            self._next = math.ceil((estimate.time + WINDOW - STAMP) * RATE)

    def add_force(self, force: HandForce) -> None:
        """Add a sample of the force on the hand, if it is finite; an older one than the last restarts the force."""
        if not all(map(math.isfinite, (*force.force, *force.torque, *force.point))):
            return
        if self._forces and force.time <= self._forces[-1].time:
            self._forces.clear()
        self._forces.append(force)

    def take(self) -> PersonLoad | None:
        """Return the load at all instants that have become known since the last call; None if there are none."""
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
        """Remove frames and forces that no window needs any more."""
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
        """Return the states of an arm at n instants; worst: of each joint and the root in the window of each."""
        rows = worst[:, [*self._chains[side].joints, self._count]].max(axis=1)
        unknown = np.array(force) == MISSING if side == self._hand else np.zeros(len(rows), np.bool_)
        return tuple(LOST if gone else _ORDER[row] for row, gone in zip(rows.tolist(), unknown, strict=True))

    def _acting(
        self, time: FloatArray, motion: RecordedMotion, root: RootMotion
    ) -> tuple[tuple[str, ...], ExternalLoad, FloatArray]:
        """Return the state of the force, the load on the hand, and their distance, at n instants."""
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
    """Fitted values at an instant.

    Attributes:
        time: time [s].
        derivatives: values of a frame with their first and second derivatives, shape (3, values).
        states: worst state of each value in the window, as indices of _ORDER.
    """

    time: float
    derivatives: FloatArray
    states: NDArray[np.int8]


class _Fitted:
    """Least-squares cubics through frames."""

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
    """Return force, torque and point at n instants, linear between samples, shape (n, 9), and which are known.

    Values are NaN and unknown if the samples are too far apart.
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
    """Return the load with NaN for unknown values; lost: by side, shape (n,)."""
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
