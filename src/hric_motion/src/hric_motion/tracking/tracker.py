"""Joint angles and root pose of a person by inverse kinematics of their markers, frame by frame.

Each frame is a weighted least-squares problem with two terms: the visible markers, and the prediction from the last
frame. The prediction has so little weight that it does not change what the markers determine. Joints that the markers
do not determine follow the prediction for a short time and are flagged as bridged; after that they are flagged as lost.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray, Pose, from_rotation_vector, quaternion_from_rotation
from hric_core.geometry.poses import difference
from hric_core.geometry.quaternions import product
from hric_human.body import Body
from hric_human.body.segments import ROOT, SIDES, side_of
from hric_human.control.human_control import resting_posture
from hric_human.control.inverse_kinematics import Solver, Task
from hric_human.control.marker_model import ROOT_MOTIONS, MarkerModel

Mask = npt.NDArray[np.bool_]
MEASURED, BRIDGED, LOST = "measured", "bridged", "lost"
"""Tracking states of the root and of joints: seen in this frame, predicted for up to BRIDGE, unknown for longer."""
BRIDGE = 0.2
"""Maximum time for which joints that the visible markers do not determine follow the prediction [s].

The constants of this file are project defaults, unconfirmed.
"""
STAMP = 1e-6
"""Tolerance for rounding errors of times [s]."""
MARKER_NOISE = 1e-3
"""Standard deviation of a marker's measured position [m]; it sets the weight of markers against the prediction."""
PREDICTED_POSITION, PREDICTED_ANGLE = 0.025, 0.05
"""Standard deviations of the prediction of the next frame [m], [rad]: so large that the markers dominate."""
LOST_SPREAD = 1.0
"""Standard deviation of the prediction of a lost root or joint [m], [rad]."""
VELOCITY_TIME, COASTING_TIME = 0.04, 0.5
"""Time constants of the velocity filter, and of the velocity's decay in the prediction [s].

The decay prevents drift of joints that cannot be distinguished, such as two of a shoulder at 90 deg of abduction.
"""
BLIND = 4.0
"""Factor by which missing markers may raise a joint's variance; above it the joint may count as not observed [1].

It counts as not observed if its variance also exceeds KNOWN_SHARE times the variance of the prediction.
"""
KNOWN_SHARE = 0.25
"""Ratio of a joint's variance to that of its prediction, up to which the joint always counts as observed [1]."""
MISPLACED, OBSERVABLE = 5e-3, 0.5
"""Standard deviation of a marker's place on its segment [m]; standard deviation of a joint that follows, with all
markers visible, relative to that of a uniform distribution over its range, from which on it is never measured [1]."""
FAR = 0.1
"""Distance of a marker from the model [m] above which it is taken as mislabelled or spurious, and ignored."""
MAX_MISLABELLED = 3
"""Maximum number of markers that are ignored as mislabelled in a frame."""
GOOD = 0.005
"""Root mean square distance of markers at which the first posture is accepted without trying others [m]."""
SETTLED, FIRST_SETTLED = 2e-3, 1e-6
"""Step sizes at which the solver stops, in general and for the first posture [rad], [m]."""
TRUNK = (ROOT, "waist", "torso")
"""Links whose markers determine the root's pose in the first frame."""
GUESSES = 12
"""Maximum number of random start postures for the first frame, from a fixed seed."""


class PersonEstimate(NamedTuple):
    """Estimated state of the person at a frame.

    Attributes:
        time: time of the frame [s].
        root: pose of the root link in the motion capture frame.
        q, dq: positions and velocities of all joints, n floats each [rad], [rad/s]; meaningless for lost joints.
        root_state: tracking state of the root: MEASURED, BRIDGED (predicted) or LOST.
        states: tracking state of each joint.
        residual: root mean square distance between measured and model markers [m]; NaN without visible markers.
        missing: names of markers that are not visible, or ignored since they are too far from the model.
    """

    time: float
    root: Pose
    q: list[float]
    dq: list[float]
    root_state: str
    states: list[str]
    residual: float
    missing: tuple[str, ...]


class _Posture(NamedTuple):
    """Candidate for the posture in the first frame, with its distances to the measured markers.

    Attributes:
        residual: root mean square of the distances [m].
        root: pose of the root link in the motion capture frame.
        q: joint positions, shape (n,) [rad].
        distances: distance of each marker from the model, shape (m,) [m].
        J: Jacobian of the markers by root motion and joints, shape (m, 3, 6 + n) [m/m], [m/rad].
    """

    residual: float
    root: Pose
    q: FloatArray
    distances: FloatArray
    J: FloatArray


class PersonTracker:
    """Tracker of one person; called from one thread.

    Args:
        body: body of the person, with a trunk; its root link moves freely.
        names: names of the markers that the person wears, in the order of positions.

    Raises:
        ParameterError: the body does not have a marker, or fewer than three markers are on the trunk.
    """

    def __init__(self, body: Body, names: Sequence[str]) -> None:
        if unknown := [name for name in names if name not in body.markers]:
            raise ParameterError(f"no markers {', '.join(unknown)} on the body; valid: {', '.join(body.markers)}")
        self._trunk = [row for row, name in enumerate(names) if body.markers[name].link in TRUNK]
        if len(self._trunk) < 3 or "torso" not in body.segments:
            raise ParameterError(
                f"{len(self._trunk)} markers are on the trunk of the body ({body.subject.parts}), too few for its "
                "pose; valid: three or more, on a subject with parts upper_body or whole_body"
            )
        self.body, self.names = body, tuple(names)
        self._marked = MarkerModel(body, names)
        low, high = np.array([joint.range for joint in body.joints.values()]).T
        free = np.full(ROOT_MOTIONS, np.inf)
        self._rest = np.array(resting_posture(body))
        still = np.concatenate([np.zeros(ROOT_MOTIONS), self._rest])
        self._solver = Solver(np.concatenate([-free, low]), np.concatenate([free, high]), still)
        position, angle = np.full(3, PREDICTED_POSITION), np.full(3 + len(low), PREDICTED_ANGLE)
        self._spread = np.concatenate([position, angle])
        self._of_side = {
            side: (
                np.array([side_of(body.markers[name].link) == side for name in names]),
                np.array([side_of(name) == side for name in body.joints]),
            )
            for side in SIDES
        }
        self._observable = self._observed_by_all(low, high)
        self.restart()

    def restart(self) -> None:
        """Discard all earlier frames; the next frame is handled as the first one."""
        n = len(self._rest)
        self._last: tuple[float, Pose, FloatArray] | None = None
        self._v, self._measured_at = np.zeros(ROOT_MOTIONS + n), np.full(ROOT_MOTIONS + n, -math.inf)

    def update(self, time: float, positions: FloatArray) -> PersonEstimate | None:
        """Estimate the state of the person from a frame.

        Args:
            time: time of the frame [s]; a time that does not increase restarts the tracker.
            positions: positions of the markers, shape (m, 3) [m]; NaN: not visible.

        Returns:
            estimate; None if too few markers of the trunk are visible, or no posture of the body fits the markers.
        """
        seen: Mask = np.array(np.isfinite(positions).all(axis=1))
        if self._last is not None and time <= self._last[0]:
            self.restart()
        if self._last is None:
            return self._first(time, positions, seen)
        since, root, q = self._last
        dt = time - since
        lost = time - self._measured_at > BRIDGE + STAMP
        coasted = np.where(lost, 0.0, self._v * math.exp(-dt / COASTING_TIME))
        guess = np.concatenate([np.zeros(ROOT_MOTIONS), q + dt * coasted[ROOT_MOTIONS:]])
        guess = guess.clip(self._solver.lower, self._solver.upper)
        root = moved(root, dt * coasted[:ROOT_MOTIONS])
        spread = np.where(lost, LOST_SPREAD, self._spread)
        x, seen, residual = self._fitted(positions, seen, root, guess, spread)
        if residual > FAR:  # false for NaN
            self.restart()
            return None
        return self._taken(time, dt, coasted, moved(root, x[:ROOT_MOTIONS]), x[ROOT_MOTIONS:], seen, residual)

    def _fitted(
        self, positions: FloatArray, seen: Mask, root: Pose, guess: FloatArray, spread: FloatArray
    ) -> tuple[FloatArray, Mask, float]:
        """Fit root and joints to the visible markers, ignoring markers that are FAR from the model.

        Args:
            positions: positions of the markers, shape (m, 3) [m].
            seen: True for visible markers, shape (m,).
            root: predicted pose of the root link.
            guess: predicted root motion (0) and joint positions, shape (6 + n,).
            spread: standard deviation of `guess`, shape (6 + n,).

        Returns:
            motion of the root from `root` and joint positions, shape (6 + n,); True for used markers, shape (m,); root
                mean square distance of the used markers [m], NaN without any.
        """
        for _ in range(1 + MAX_MISLABELLED):
            x, _ = self._solver.solve(self._task(positions, seen, root, guess, spread), guess, 0.0, SETTLED)
            distances = np.linalg.norm(positions - self._p, axis=1)
            worst = int(np.argmax(np.where(seen, distances, 0.0)))
            if not seen[worst] or distances[worst] <= FAR:
                break
            seen = seen & (np.arange(len(seen)) != worst)
        return x, seen, float(np.sqrt(np.mean(distances[seen] ** 2))) if seen.any() else math.nan

    def _task(self, positions: FloatArray, seen: Mask, root: Pose, guess: FloatArray, spread: FloatArray) -> Task:
        """Return the least-squares task: marker errors over MARKER_NOISE, and deviations from `guess` over `spread`."""
        prior = np.diag(1.0 / spread)

        def task(x: list[float]) -> tuple[FloatArray, FloatArray]:
            # Stored for later use: the solver's last call is at its solution.
            p, J = self._p, self._J = self._marked.at(x[ROOT_MOTIONS:], moved(root, x[:ROOT_MOTIONS]))
            error = np.concatenate([(positions - p)[seen].ravel() / MARKER_NOISE, (guess - x) / spread])
            return error, np.vstack([J[seen].reshape(-1, len(x)) / MARKER_NOISE, prior])

        return task

    def _taken(
        self,
        time: float,
        dt: float,
        coasted: FloatArray,
        root: Pose,
        q: FloatArray,
        seen: Mask,
        residual: float,
    ) -> PersonEstimate:
        """Store root pose and joint positions of this frame, update the velocities, and return the estimate."""
        assert self._last is not None
        _, before, q_before = self._last
        shown = self._shown(seen)
        moved = np.concatenate([difference(root, before), q - q_before]) / dt
        steady = shown & (time - dt - self._measured_at < 0.5 * dt)  # not for a joint just seen again
        self._v = np.where(steady, coasted + (1.0 - math.exp(-dt / VELOCITY_TIME)) * (moved - coasted), coasted)
        self._measured_at[shown] = time
        self._last = (time, root, q)
        return self._estimate(seen, residual)

    def _shown(self, seen: Mask) -> Mask:
        """Return True for root motions and joints that the markers `seen` determine, shape (6 + n,).

        The criterion is the variance of the least-squares solution, see BLIND and KNOWN_SHARE.
        """
        if seen.all():
            return self._observable
        variances = [self._variances(rows) for rows in (seen, np.ones(len(seen), dtype=bool))]
        shown = (variances[0] < BLIND * variances[1]) | (variances[0] < KNOWN_SHARE * self._spread**2)
        return np.asarray(shown & self._observable)

    def _observed_by_all(self, low: FloatArray, high: FloatArray) -> Mask:
        """Return True for root motions and joints that all worn markers determine in a usual posture, shape (6 + n,).

        Args:
            low: lower ends of the joints' ranges, shape (n,) [rad].
            high: upper ends, shape (n,) [rad].
        """
        alone = np.concatenate([np.full(ROOT_MOTIONS, LOST_SPREAD), (high - low) / math.sqrt(12.0)])
        observed = np.zeros(len(alone), dtype=bool)
        for q in (self._rest, 0.5 * (low + high)):
            J = self._marked.at(q.tolist(), Pose())[1].reshape(-1, len(alone)) / MISPLACED
            variances = np.diag(np.linalg.inv(J.T @ J + np.diag(alone**-2.0)))
            observed |= variances < (OBSERVABLE * alone) ** 2
        return observed

    def _variances(self, rows: Mask) -> FloatArray:
        J = self._J[rows].reshape(-1, len(self._spread)) / MARKER_NOISE
        return np.asarray(np.diag(np.linalg.inv(J.T @ J + np.diag(self._spread**-2.0))))

    def _estimate(self, seen: Mask, residual: float) -> PersonEstimate:
        assert self._last is not None
        time, root, q = self._last
        age = time - self._measured_at
        states = np.where(age <= 0.0, MEASURED, np.where(age <= BRIDGE + STAMP, BRIDGED, LOST)).tolist()
        of_root = next(state for state in (LOST, BRIDGED, MEASURED) if state in (*states[:ROOT_MOTIONS], MEASURED))
        missing = tuple(name for name, here in zip(self.names, seen, strict=True) if not here)
        dq = self._v[ROOT_MOTIONS:].tolist()
        return PersonEstimate(time, root, q.tolist(), dq, of_root, states[ROOT_MOTIONS:], residual, missing)

    # -- the beginning -------------------------------------------------------------------------------------------------

    def _first(self, time: float, positions: FloatArray, seen: Mask) -> PersonEstimate | None:
        """Return the estimate of the first frame; None if no posture fits."""
        if sum(seen[self._trunk]) < 3:
            return None
        random, best = np.random.default_rng(0), self._settled(positions, seen, self._rest)
        for _ in range(GUESSES):
            if best.residual < GOOD:
                break
            # The worst-fitting limb gets another guess.
            side = max(SIDES, key=lambda candidate: best.distances[self._of_side[candidate][0] & seen].max(initial=0.0))
            q = random.uniform(self._solver.lower[ROOT_MOTIONS:], self._solver.upper[ROOT_MOTIONS:])
            other = self._settled(positions, seen, np.where(self._of_side[side][1], q, best.q))
            best = min(best, other, key=lambda candidate: candidate.residual)
        if best.residual > FAR:
            return None
        self._last, self._J = (time, best.root, best.q), best.J
        self._measured_at[self._shown(seen)] = time
        return self._estimate(seen, best.residual)

    def _settled(self, positions: FloatArray, seen: Mask, q: FloatArray) -> "_Posture":
        """Return the posture near joint positions q that fits the visible markers best."""
        root, free = self.root_from_trunk(positions, seen, q), np.full(len(self._spread), LOST_SPREAD)
        for _ in range(2):  # the second time since the first one linearises the root's rotation
            guess = np.concatenate([np.zeros(ROOT_MOTIONS), q])
            x, _ = self._solver.solve(self._task(positions, seen, root, guess, free), guess, 0.0, FIRST_SETTLED)
            root, q = moved(root, x[:ROOT_MOTIONS]), x[ROOT_MOTIONS:]
        distances = np.linalg.norm(positions - self._p, axis=1)
        return _Posture(float(np.sqrt(np.mean(distances[seen] ** 2))), root, q, distances, self._J)

    def root_from_trunk(self, positions: FloatArray, seen: Mask, q: FloatArray) -> Pose:
        """Return the pose of the root link that best fits the trunk's visible markers (Kabsch 1976).

        Args:
            positions: positions of the markers, shape (m, 3) [m].
            seen: True for visible markers, shape (m,).
            q: joint positions, shape (n,) [rad].
        """
        rows = [row for row in self._trunk if seen[row]]
        there, body = positions[rows], self._marked.at(q.tolist(), Pose())[0][rows]
        U, _, Vt = np.linalg.svd((there - there.mean(axis=0)).T @ (body - body.mean(axis=0)))
        R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        x, y, z = (there.mean(axis=0) - R @ body.mean(axis=0)).tolist()
        return Pose((x, y, z), quaternion_from_rotation(R))


def moved(root: Pose, motion: Sequence[float] | FloatArray) -> Pose:
    """Return a pose moved by a translation [m] and a rotation vector [rad], 6 numbers in world axes."""
    dx, dy, dz, *rotation = (float(value) for value in motion)
    x, y, z = root.position
    return Pose((x + dx, y + dy, z + dz), product(from_rotation_vector(rotation), root.orientation))
