"""Fit of a person's body to a recorded motion: lengths, marker places and postures in one least-squares problem.

The unknowns are the postures of some frames, and what these share: the size of the body, its segment lengths and the
places of the markers on the segments. Priors say how far each of them may be from the table of de Leva, from the marker
set and from the middle of a joint's range; so there is a solution for any set of markers, and its covariance shows what
the markers determine. Shared unknowns are eliminated by their Schur complement (Triggs et al., Bundle adjustment,
section 6, 2000), and steps are damped as Levenberg and Marquardt do.

    fit = BodyFit(subject, names, positions)       # positions: shape (frames, markers, 3) [m], NaN: not visible
    motion = fit.motion(all_positions)
    motion.postures.q, motion.spread               # joint angles and their standard deviations [rad]
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from hric_core.errors import HricError, ParameterError
from hric_core.geometry import FloatArray
from hric_human.body import Body, Subject, describe
from hric_human.body.markers import ExtraMarker, markers
from hric_human.body.segments import ROOT, SIDES, Builder, segments
from hric_human.control.marker_model import ROOT_MOTIONS
from hric_motion.pelvis import PelvisPrior, pelvis_prior
from hric_motion.postures import BodyPostures, Geometry, MarkerPostures

NOISE = 0.001
"""Smallest standard deviation of a marker from the rigid segment that it is on: noise and moving skin [m].

A fit whose residual is larger uses its residual instead. The constants of this file are project defaults, unconfirmed.
"""
SIZE_SPREAD, LENGTH_SPREAD = 0.1, 0.04
"""Prior standard deviations of the logarithms of the body's size, and of each length relative to it [1]."""
TRUNK_SPREAD = 0.15
"""Prior standard deviation of the logarithm of the lower trunk's length [1]: one joint replaces the lumbar spine."""
WAIST_SPREAD = 0.03
"""Prior standard deviation of the forward position of this joint, the waist [m]."""
BONE_SPREAD, LOOSE_SPREAD = 0.007, 0.04
"""Prior standard deviations of a marker's place on its segment [m]: on a palpable bone, and on soft tissue."""
FARTHEST = 5.0
"""Largest distance of size, lengths and marker places from their priors, in standard deviations [1]."""
LOOSE = ("THI", "TIB", "UPA", "FRM", "RBAK")
"""Endings of the names of markers that are on soft tissue or on a wand."""
FRAMES = 80
"""Number of frames of a motion to which the body is fitted."""
BEYOND = 0.26
"""Angle by which a joint may exceed the range of the table [rad]: 15 deg, as some people's knees and elbows do."""
ROUNDS, ROUNDED = 12, 0.01
"""Largest number of rounds of a fit; relative change of the noise below which a round is the last one [1]."""
COARSE, FINE = 0.3, 3e-4
"""Noise of the first round, relative to the residual before the fit; relative change of the cost that ends a round."""
KNOT = 10
"""Number of frames between two whose postures are searched from all start postures; the others start at the nearest."""
BLOCK = 400
"""Number of frames whose motion is computed at once."""
STEPS, SETTLED = 60, 1e-4
"""Largest number of steps of a fit, and the step [m], [rad] below which it has settled."""
SAMPLED, LOWER = 8, 0.9
"""Number of frames in which a start posture is tried first; ratio of costs below which it is then tried in all [1]."""
POOR, ATTEMPTS = 2.0, 4
"""Cost per marker, relative to the median, above which a frame starts again from other postures; random starts."""
LARGEST_TURN = 0.4
"""Largest rotation of a joint or the root in one step [rad]."""
DIFFERENCE = 1e-4
"""Step of the finite differences by logarithms of size and lengths [1], and by the waist's position [m]."""
UNSEEN = 1e-3
"""Weight that keeps the root of a person without visible markers [1/m^2], [1/rad^2]: far below that of a marker."""
PINNED = 1e12
"""Weight that keeps a joint at the end of its range [1/rad^2]."""
TRUNK = (ROOT, "waist", "torso")
"""Links whose markers determine the pose of the root at the start."""
STARTS: tuple[dict[str, float], ...] = (
    {},
    {"sh_flex": 80.0, "el_flex": 40.0},
    {"sh_abd": 80.0},
    {"sh_flex": 160.0},
    {"hip_flex": 80.0, "knee_flex": 80.0, "el_flex": 80.0},
)
"""Start postures: angles of the joints of both sides that are not zero [deg]."""


Mask = npt.NDArray[np.bool_]
Progress = Callable[[int, int], object]
"""Callback with the number of finished frames, and the number of all frames."""
Arrays = TypeVar("Arrays", BodyPostures, "_Equations")


class FittedMotion(NamedTuple):
    """Motion of a fitted body.

    Attributes:
        postures: postures of the frames.
        spread: standard deviations of the joint angles, shape (n, j) [rad].
        distances: distances of the markers from the model, shape (n, m) [m]; NaN: not visible.
    """

    postures: BodyPostures
    spread: FloatArray
    distances: FloatArray


class _Equations(NamedTuple):
    """Normal equations of n frames at a linearisation.

    Attributes:
        H: matrix of the postures, shape (n, 6 + j, 6 + j).
        g: right side of the postures, shape (n, 6 + j).
        cost: cost of each frame, shape (n,).
        Jf: weighted Jacobian of the posture, shape (n, 3 m, 6 + j).
        r: weighted residual, shape (n, 3 m).
        pinned: True for joints at the end of their range that the markers push beyond, shape (n, j).
        w: weights of the markers, 0 if not visible, shape (n, m) [1/m].
        R: rotations of the links that the markers are on, shape (n, m, 3, 3).
    """

    H: FloatArray
    g: FloatArray
    cost: FloatArray
    Jf: FloatArray
    r: FloatArray
    pinned: FloatArray
    w: FloatArray
    R: FloatArray


class BodyFit:
    """Fit of a body to marker positions; the constructor computes it.

    Args:
        subject: subject whose table of lengths is the prior.
        names: names of the markers.
        positions: positions of the markers in the frames of the fit, shape (n, m, 3) [m]; NaN: not visible.
        extra: markers that are not in the table of the body.

    Attributes:
        names: names of the markers.
        trunk: rows of the markers on the trunk.
        noise: standard deviation of the markers from the fitted body [m].
        prior_spread: standard deviations of the joint angles without markers, shape (j,) [rad].
        before: root mean square distance of each marker from the body of the table, shape (m,) [m]; NaN: not visible.

    Raises:
        HricError: the markers do not determine the pose of the trunk.
    """

    def __init__(
        self, subject: Subject, names: Sequence[str], positions: FloatArray, extra: Sequence[ExtraMarker] = ()
    ) -> None:
        self.names, self._subject, table = tuple(names), subject, describe(subject)
        self._markers = {marker.name: marker for marker in markers(segments(subject), extra)}
        self.trunk = tuple(row for row, name in enumerate(names) if self._markers[name].link in TRUNK)
        if len(self.trunk) < 3:
            raise HricError(f"{len(self.trunk)} markers are on the trunk; valid: three or more, for its pose")
        low, high = np.array([joint.range for joint in table.joints.values()]).T
        self._low, self._high = low - BEYOND, high + BEYOND
        self._mean, self.prior_spread = np.clip(0.0, low, high), (high - low) / np.sqrt(12.0)
        starts = [{f"{side}_{name}": angle for name, angle in start.items() for side in SIDES} for start in STARTS]
        self._starts = [np.radians([start.get(joint, 0.0) for joint in table.joints]) for start in starts]
        self._table, self._model = Builder(subject).lengths, MarkerPostures(table, names, extra)
        soft = {marker.name for marker in extra if marker.loose}
        loose = np.array([name.endswith(LOOSE) or name in soft for name in names])
        offsets = np.repeat(np.where(loose, LOOSE_SPREAD, BONE_SPREAD), 3)
        relative = [TRUNK_SPREAD if name == "lower_trunk" else LENGTH_SPREAD for name in self._table]
        self._shared_spread = np.array([SIZE_SPREAD, *relative, WAIST_SPREAD, *offsets])
        self._scaled, self._on_pelvis = np.ones(len(self._table)), np.full((len(names), 3), np.nan)
        self._take(pelvis_prior(names, positions))
        self._shared, self.noise = np.zeros(len(self._shared_spread)), NOISE
        self._covariance = np.diag(self._shared_spread**2)
        self._set(self._shared)
        # The frames of the fit have one prior together: the person may hold a posture that is far from the middle.
        self._posture_spread = np.sqrt(len(positions)) * self.prior_spread
        self._fit(positions)
        self._posture_spread = self.prior_spread

    def _take(self, pelvis: PelvisPrior | None) -> None:
        """Replace the table's prior of the hips by `pelvis`, which does not scale with size; None: keep the table's."""
        if pelvis is None or abs(np.log(pelvis.hip_width / self._table["hip_width"])) > FARTHEST * SIZE_SPREAD:
            return  # the width is not that of a person
        at = list(self._table).index("hip_width")
        self._table["hip_width"], self._scaled[at] = pelvis.hip_width, 0.0
        self._shared_spread[1 + at] = pelvis.width_spread
        spreads = self._shared_spread[-3 * len(self.names) :].reshape(-1, 3)
        for name, position in pelvis.positions.items():
            row = self.names.index(name)
            self._on_pelvis[row], spreads[row] = position, pelvis.spread

    @cached_property
    def body(self) -> Body:
        """Fitted body, with the fitted places of the markers."""
        body = describe(self._subject_of(self._shared))
        markers = zip(self.names, self._geometry.markers, strict=True)
        fitted = {name: replace(self._markers[name], p_link_marker=p_link) for name, p_link in markers}
        return replace(body, markers={**body.markers, **fitted})

    def motion(self, positions: FloatArray, progress: Progress = lambda done, total: None) -> FittedMotion:
        """Return the motion of the fitted body that fits the markers best.

        Args:
            positions: positions of the markers, shape (n, m, 3) [m]; NaN: not visible.
            progress: callback after each block of frames, see `Progress`.
        """
        knots = np.unique(np.append(np.arange(0, len(positions), KNOT), len(positions) - 1))
        known, parts = self._started(positions[knots]), list[FittedMotion]()
        for begin in range(0, len(positions), BLOCK):
            rows = np.arange(begin, min(begin + BLOCK, len(positions)))
            parts.append(self._block(positions[rows], known.rows(np.abs(rows[:, None] - knots).argmin(axis=1))))
            progress(int(rows[-1]) + 1, len(positions))
        postures = BodyPostures(*map(np.concatenate, zip(*(part.postures for part in parts), strict=True)))
        return FittedMotion(postures, *[np.concatenate([part[k] for part in parts]) for k in (1, 2)])

    # -- shared unknowns -----------------------------------------------------------------------------------------------

    def _subject_of(self, shared: FloatArray) -> Subject:
        factors = np.exp(shared[0] * self._scaled + shared[1 : 1 + len(self._table)])
        lengths = (np.array(list(self._table.values())) * factors).tolist()
        waist = float(shared[1 + len(self._table)])
        return replace(self._subject, lengths=dict(zip(self._table, lengths, strict=True)), waist_forward=waist)

    def _geometry_of(self, shared: FloatArray) -> Geometry:
        geometry = self._model.geometry_of(segments(self._subject_of(shared)))
        prior = np.where(np.isnan(self._on_pelvis), geometry.markers, self._on_pelvis)
        return geometry._replace(markers=prior + shared[-3 * len(self.names) :].reshape(-1, 3))

    def _set(self, shared: FloatArray) -> None:
        """Set the shared unknowns, and compute the geometry and its derivatives by size, lengths and waist."""
        self._shared, self._geometry = shared, self._geometry_of(shared)
        self._changes = []
        for index in range(2 + len(self._table)):
            step = np.zeros(len(shared))
            step[index] = DIFFERENCE
            after = self._geometry_of(shared + step)
            self._changes.append(Geometry(*((b - a) / DIFFERENCE for a, b in zip(self._geometry, after, strict=True))))

    # -- the least-squares problem -------------------------------------------------------------------------------------

    def _equations(self, positions: FloatArray, postures: BodyPostures, geometry: Geometry) -> _Equations:
        placed = self._model.at(postures, geometry)
        n, m = positions.shape[:2]
        w = seen_in(positions) / self.noise
        r = (np.nan_to_num(positions - placed.p) * w[..., None]).reshape(n, 3 * m)
        Jf = (placed.J * w[..., None, None]).reshape(n, 3 * m, -1)
        off = (self._mean - postures.q) / self._posture_spread
        H, g = Jf.swapaxes(1, 2) @ Jf, (Jf.swapaxes(1, 2) @ r[..., None])[..., 0]
        g[:, ROOT_MOTIONS:] += off / self._posture_spread
        at = np.arange(ROOT_MOTIONS, H.shape[1])
        H[:, at, at] += self._posture_spread**-2.0
        pinned = ((postures.q <= self._low) & (g[:, at] < 0.0)) | ((postures.q >= self._high) & (g[:, at] > 0.0))
        H[:, at, at] += PINNED * pinned
        H[:, range(ROOT_MOTIONS), range(ROOT_MOTIONS)] += UNSEEN
        cost = (r**2).sum(axis=1) + (off**2).sum(axis=1)
        return _Equations(H, g, cost, Jf, r, pinned.astype(float), np.asarray(w), placed.R)

    def _by_shared(self, postures: BodyPostures, equations: _Equations) -> FloatArray:
        """Return the weighted derivatives of the markers by the shared unknowns, shape (n, 3 m, s)."""
        n, m = equations.w.shape
        J = np.zeros((n, m, 3, len(self._shared)))
        J[..., : len(self._changes)] = self._model.by_geometry(postures, self._changes)
        for row in range(m):
            begin = len(self._changes) + 3 * row
            J[:, row, :, begin : begin + 3] = equations.R[:, row]
        return np.asarray((J * equations.w[..., None, None]).reshape(n, 3 * m, -1))

    def _stepped(self, postures: BodyPostures, step: FloatArray) -> BodyPostures:
        """Return the postures after a step of limited size, within the ranges of the joints."""
        largest = np.abs(step[:, 3:]).max(axis=1, keepdims=True)
        moved = postures.moved(step * np.minimum(1.0, LARGEST_TURN / np.maximum(largest, 1e-12)))
        return moved._replace(q=moved.q.clip(self._low, self._high))

    def _solved(self, positions: FloatArray, postures: BodyPostures) -> tuple[BodyPostures, FloatArray]:
        """Return the postures that fit the markers best, and their costs [1], for the body as known so far.

        Args:
            positions: measured markers, NaN if not visible, shape (n, m, 3) [m].
            postures: postures of the n frames from which the search starts.
        """
        postures = BodyPostures(*(array.copy() for array in postures))
        cost, rows = np.zeros(len(positions)), np.arange(len(positions))  # rows: the frames that have not settled
        equations = self._equations(positions, postures, self._geometry)
        damping = np.full(len(positions), 1e-3)
        for _ in range(STEPS):
            now = postures.rows(rows)
            H = equations.H.copy()
            np.einsum("nii->ni", H)[...] *= 1.0 + damping[:, None]
            step = np.asarray(np.linalg.solve(H, equations.g[..., None])[..., 0], dtype=np.float64)
            tried = self._stepped(now, step)
            after = self._equations(positions[rows], tried, self._geometry)
            better = np.asarray(after.cost <= equations.cost)
            damping = np.where(better, 0.1 * damping, 10.0 * damping).clip(1e-9, 1e6)
            now, equations = _chosen(better, tried, now), _chosen(better, after, equations)
            for array, new in zip(postures, now, strict=True):
                array[rows] = new
            cost[rows] = equations.cost
            left = ~((np.abs(step).max(axis=1) < SETTLED) | (damping >= 1e6))
            if not left.any():
                break
            rows, damping, equations = rows[left], damping[left], _Equations(*(array[left] for array in equations))
        return postures, cost

    def _started(self, positions: FloatArray) -> BodyPostures:
        """Return the postures that fit the markers best, searched from all start postures."""
        postures, cost = self._solved(positions, self._at_start(positions, self._starts[0]))
        sample = np.unique(np.linspace(0, len(positions) - 1, SAMPLED).round().astype(int))
        for start in self._starts[1:]:  # a few frames show whether a start helps at all
            _, lower = self._solved(positions[sample], self._at_start(positions, start).rows(sample))
            if (lower < LOWER * cost[sample]).any():
                other, lower = self._solved(positions, self._at_start(positions, start))
                postures, cost = _chosen(lower < cost, other, postures), np.minimum(lower, cost)
        return self._improved(positions, postures, cost)

    def _improved(self, positions: FloatArray, postures: BodyPostures, cost: FloatArray) -> BodyPostures:
        """Return the postures, after a second search for the frames that fit much worse than the others.

        It starts at the nearest frames before and after that fit well, at the start postures, and at random ones.
        """
        random, seen = np.random.default_rng(0), seen_in(positions).sum(axis=1)
        shares = cost / np.maximum(seen, 1)
        for attempt in range(len(self._starts) + ATTEMPTS):
            poor = np.flatnonzero(shares > max(POOR * float(np.median(shares)), 3.0))
            if not len(poor):
                break
            good = np.setdiff1d(np.arange(len(cost)), poor)
            q = np.tile(self._starts[min(attempt, len(self._starts) - 1)], (len(poor), 1))
            if attempt in (0, 1) and len(good):  # the nearest frame before or after
                at = np.searchsorted(good, poor) - 1 + attempt
                q = postures.q[good[at.clip(0, len(good) - 1)]]
            elif attempt > len(self._starts):
                q = random.uniform(self._low, self._high, q.shape)
            start = self._at_start(positions[poor], q, postures.rows(poor))
            other, lower = self._solved(positions[poor], start)
            better = lower < cost[poor]
            for array, new in zip(postures, other, strict=True):
                array[poor[better]] = new[better]
            cost[poor[better]] = lower[better]
            shares = cost / np.maximum(seen, 1)
        return postures

    def _at_start(self, positions: FloatArray, q: FloatArray, before: BodyPostures | None = None) -> BodyPostures:
        """Return postures with joint positions q, shape (j,) or (n, j) [rad], and the root that fits the trunk best.

        A frame with fewer than three markers on the trunk gets the root of the nearest frame with three; if there is no
        such frame, all get the roots of `before`.

        Raises:
            HricError: no frame has three markers on the trunk, and `before` is None.
        """
        q = np.broadcast_to(q, (len(positions), len(self._mean)))
        still = BodyPostures(np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3)), q)
        body = self._model.positions(still, self._geometry)[:, list(self.trunk)]
        there = positions[:, list(self.trunk)]
        seen = seen_in(there)
        known = np.flatnonzero(seen.sum(axis=1) >= 3)
        if not len(known) and before is not None:
            return before._replace(q=q.copy())
        if not len(known):
            raise HricError("no frame has three visible markers of the trunk; valid: three or more, for its pose")
        poses = {int(row): _kabsch(body[row, seen[row]], there[row, seen[row]]) for row in known}
        nearest = known[np.abs(np.arange(len(positions))[:, None] - known).argmin(axis=1)]
        R, p = (np.stack([poses[int(row)][k] for row in nearest]) for k in (0, 1))
        return BodyPostures(R, p, q.copy())

    def _fit(self, positions: FloatArray) -> None:
        """Fit the shared unknowns and the postures; set noise and covariance."""
        postures = self._started(positions)
        off = np.linalg.norm(positions - self._model.positions(postures, self._geometry), axis=2)
        self.before = np.sqrt(np.nansum(off**2, axis=0) / np.isfinite(off).sum(axis=0))
        self.noise = max(NOISE, COARSE * float(np.sqrt(np.nanmean(off**2))))
        for _ in range(ROUNDS):  # with the noise and the postures of the round before
            before = self.noise
            postures = self._fitted(positions, postures)
            postures = self._improved(positions, *self._solved(positions, postures))
            equations = self._equations(positions, postures, self._geometry)
            free = max(1.0, 3.0 * (equations.w > 0.0).sum() - self._determined(postures, equations))
            self.noise = max(NOISE, self.noise * float(np.sqrt((equations.r**2).sum() / free)))
            if abs(self.noise - before) < ROUNDED * before:
                break
        S, _, _ = self._reduced(postures, self._equations(positions, postures, self._geometry))
        self._covariance = np.linalg.inv(S)

    def _determined(self, postures: BodyPostures, equations: _Equations) -> float:
        """Return the number of unknowns that markers determine; one that priors determine, too, counts in part."""
        of_markers = equations.Jf.swapaxes(1, 2) @ equations.Jf
        own = float(np.einsum("nij,nji->", np.linalg.inv(equations.H), of_markers))
        S, _, _ = self._reduced(postures, equations)
        return own + len(S) - float((np.diag(np.linalg.inv(S)) * self._shared_spread**-2.0).sum())

    def _reduced(
        self, postures: BodyPostures, equations: _Equations, damping: float = 0.0
    ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
        """Return matrix and right side of the normal equations of the s shared unknowns, shape (s, s) and (s,).

        Returns:
            also y, shape (n, 6 + j), and X, shape (n, 6 + j, s): the postures' step is y - X ds for a step ds.
        """
        J = self._by_shared(postures, equations)
        H = equations.H + damping * np.einsum("nii->ni", equations.H)[:, :, None] * np.eye(equations.H.shape[1])
        mixed = equations.Jf.swapaxes(1, 2) @ J
        solved = np.linalg.solve(H, np.concatenate([mixed, equations.g[..., None]], axis=2))
        X, y = solved[..., :-1], solved[..., -1]
        flat = J.reshape(-1, J.shape[2])
        shared = flat.T @ flat + np.diag(self._shared_spread**-2.0)
        g = flat.T @ equations.r.ravel() - self._shared * self._shared_spread**-2.0
        shared[np.diag_indices(len(g))] *= 1.0 + damping
        return shared - np.tensordot(mixed, X, ((0, 1), (0, 1))), g - np.tensordot(mixed, y, ((0, 1), (0, 1))), (y, X)

    def _fitted(self, positions: FloatArray, postures: BodyPostures) -> BodyPostures:
        """Fit shared unknowns and postures near the current ones; return the postures."""
        equations, damping = self._equations(positions, postures, self._geometry), 1e-3
        cost, farthest = self._cost(equations, self._shared), FARTHEST * self._shared_spread
        for _ in range(STEPS):
            S, g, (y, X) = self._reduced(postures, equations, damping)
            at_end = np.abs(self._shared) >= farthest * (1.0 - 1e-9)
            free = ~at_end | (g * self._shared < 0.0)  # an unknown at its limit does not go beyond it
            ds = np.zeros(len(g))
            ds[free] = np.linalg.solve(S[np.ix_(free, free)], g[free])
            shared = np.clip(self._shared + ds, -farthest, farthest)
            tried = self._stepped(postures, y - X @ (shared - self._shared))
            try:
                after = self._equations(positions, tried, self._geometry_of(shared))
            except ParameterError:  # a body cannot have these lengths
                damping *= 10.0
                continue
            lower = self._cost(after, shared)
            damping = max(1e-9, 0.2 * damping) if lower <= cost else 10.0 * damping
            if lower <= cost:
                settled = cost - lower < FINE * cost
                postures, equations, cost = tried, after, lower
                self._set(shared)
                if settled:
                    break
            elif damping > 1e6:
                break
        return postures

    def _cost(self, equations: _Equations, shared: FloatArray) -> float:
        return float(equations.cost.sum() + ((shared / self._shared_spread) ** 2).sum())

    def _block(self, positions: FloatArray, start: BodyPostures) -> FittedMotion:
        """Return the motion of some frames; start: postures from which the search starts."""
        postures, _ = self._solved(positions, start)
        equations = self._equations(positions, postures, self._geometry)
        distances = np.linalg.norm(positions - self._model.positions(postures, self._geometry), axis=2)
        return FittedMotion(postures, self._spread(postures, equations), distances)

    def _spread(self, postures: BodyPostures, equations: _Equations) -> FloatArray:
        """Return the standard deviations of the joint angles, shape (n, j) [rad].

        An angle that markers push beyond its range is not determined: it has the deviation without markers.
        """
        _, _, (_, X) = self._reduced(postures, equations)
        own = np.einsum("nii->ni", np.linalg.inv(equations.H))
        variance = own + np.einsum("nis,nis->ni", X @ self._covariance, X)
        spread = np.minimum(np.sqrt(variance[:, ROOT_MOTIONS:]), self.prior_spread)
        return np.asarray(np.where(equations.pinned, self.prior_spread, spread))


def seen_in(positions: FloatArray) -> Mask:
    """Return True for visible markers, shape (n, m); positions: shape (n, m, 3) [m], NaN: not visible."""
    return np.asarray(np.isfinite(positions).all(axis=2))


def _chosen(rows: Mask, first: Arrays, second: Arrays) -> Arrays:
    """Return for each instant the arrays of the first where `rows` is True, else of the second."""
    pairs = zip(first, second, strict=True)
    return type(first)(*(np.where(rows.reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in pairs))


def _kabsch(body: FloatArray, there: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rotation and position that map points of a body best to measured points, shape (k, 3) each [m]."""
    U, _, Vt = np.linalg.svd((there - there.mean(axis=0)).T @ (body - body.mean(axis=0)))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return R, there.mean(axis=0) - R @ body.mean(axis=0)
