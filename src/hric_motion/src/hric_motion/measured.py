"""Joint angles of a recorded person, without those that markers do not determine, and without badly fitting frames."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.body import Body, Subject
from hric_human.body.markers import ExtraMarker
from hric_motion.fit import FRAMES, BodyFit, Progress, seen_in
from hric_motion.tracking.tracker import BRIDGE

MAX_DISTANCE = 0.03
"""Root mean square distance of the markers from the body above which a frame counts as not fitted [m].

The constants of this file are project defaults, unconfirmed.
"""
MIN_SHARE = 0.5
"""Smallest share of the frames that must be fitted; below it the whole trial is refused [1]."""
KNOWN = 0.5
"""Ratio of the standard deviation of a joint angle to that of its prior from which on the angle is not known [1].

Without markers it is 1: the prior is a uniform distribution over the joint's range.
"""


@dataclass(frozen=True)
class MeasuredMotion:
    """Motion of a person.

    Attributes:
        body: body that was fitted to the person, with the fitted places of the markers.
        names: names of the markers.
        q: joint positions, shape (n, j) [rad]; NaN: not known.
        spread: their standard deviations, shape (n, j) [rad].
        root: poses of the root link in the laboratory, position and quaternion (x, y, z, w), shape (n, 7) [m]; NaN: not
            known.
        distances: distances of the markers from the body, shape (n, m) [m]; NaN: not visible.
        before: root mean square distance of each marker from the body of the table, in the frames of the fit, shape
            (m,) [m].
        noise: standard deviation of the markers from the fitted body [m].
    """

    body: Body
    names: tuple[str, ...]
    q: FloatArray
    spread: FloatArray
    root: FloatArray
    distances: FloatArray
    before: FloatArray
    noise: float

    @property
    def residual(self) -> FloatArray:
        """Root mean square distance of the markers in each frame, shape (n,) [m]; NaN: none is visible."""
        return _rms(self.distances, axis=1)

    @property
    def after(self) -> FloatArray:
        """Root mean square distance of each marker from the fitted body, shape (m,) [m]; NaN: never visible."""
        return _rms(self.distances, axis=0)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Joints of which no angle is known."""
        known = np.isfinite(self.q)
        return tuple(name for column, name in enumerate(self.body.joints) if not known[:, column].any())


def measured(
    subject: Subject,
    names: Sequence[str],
    positions: FloatArray,
    rate: float,
    extra: Sequence[ExtraMarker] = (),
    still: FloatArray | None = None,
    progress: Progress = lambda done, total: None,
) -> MeasuredMotion:
    """Fit a body to the markers of a trial, and return the motion of the person.

    Args:
        subject: subject with the person's height, mass and sex; its table of lengths is where the fit begins.
        names: names of the markers.
        positions: positions of the markers, shape (n, m, 3) [m]; NaN: not visible.
        rate: rate of the frames [Hz].
        extra: markers that are not in the table of the body.
        still: positions of the same markers in a static trial, shape (k, markers, 3) [m], whose frames are half of
            those of the fit; the person may sway. None: there is none.
        progress: called with the number of frames that are done, and that of all.

    Raises:
        HricError: the markers do not determine the pose of the trunk, or the body does not fit them.
    """
    filled = bridged(positions, rate)
    seen, parts = seen_in(filled), [filled] if still is None else [still, filled]
    chosen = np.concatenate([_spread_out(part, FRAMES // len(parts)) for part in parts])
    with threadpool_limits(1):  # small matrices: a second thread costs more than it helps, much more on a busy machine
        fit = BodyFit(subject, names, chosen, extra)
        motion = fit.motion(filled, progress)
    q = np.where(motion.spread < KNOWN * fit.prior_spread, motion.postures.q, np.nan)
    root = np.hstack([motion.postures.p, Rotation.from_matrix(motion.postures.R).as_quat()])
    distances = np.where(seen_in(positions), motion.distances, np.nan)
    fitted = np.asarray(_rms(motion.distances, axis=1) <= MAX_DISTANCE)  # False for NaN
    visible = seen[:, list(fit.trunk)].sum(axis=1) >= 3
    fitted &= visible
    _check_fitted(float(fitted[visible].mean()), names, motion.distances)
    q[~fitted], root[~fitted] = np.nan, np.nan
    return MeasuredMotion(fit.body, fit.names, q, motion.spread, root, distances, fit.before, fit.noise)


def _check_fitted(share: float, names: Sequence[str], distances: FloatArray) -> None:
    """Check that enough of the frames that show the trunk are fitted. Raises HricError, with the worst markers."""
    if share >= MIN_SHARE:
        return
    after = _rms(distances, axis=0)
    worst = sorted(zip(names, after, strict=True), key=lambda pair: -np.nan_to_num(pair[1]))[:3]
    raise HricError(
        f"the body fits the markers within {1e3 * MAX_DISTANCE:.0f} mm in {share:.0%} of the frames that show the "
        f"trunk; valid: {MIN_SHARE:.0%} or more. Farthest off: "
        + ", ".join(f"{name} {1e3 * off:.0f} mm" for name, off in worst)
        + ". Check labels, unit and vertical axis"
    )


def bridged(positions: FloatArray, rate: float) -> FloatArray:
    """Return marker positions in which gaps of at most BRIDGE between two visible frames are filled by cubic splines.

    Args:
        positions: positions of the markers, shape (n, m, 3) [m]; NaN: not visible.
        rate: rate of the frames [Hz].
    """
    filled, visible, frames = positions.copy(), seen_in(positions), np.arange(len(positions))
    for marker in range(positions.shape[1]):
        seen = np.flatnonzero(visible[:, marker])
        if len(seen) < 4 or len(seen) == len(frames):
            continue
        hole = np.diff(seen)
        short = np.repeat((hole > 1) & (hole <= BRIDGE * rate + 1e-9), np.maximum(hole - 1, 0))
        missing = np.setdiff1d(frames[seen[0] : seen[-1]], seen)[short]
        filled[missing, marker] = CubicSpline(seen, positions[seen, marker])(missing)
    return filled


def _spread_out(positions: FloatArray, count: int) -> FloatArray:
    """Return up to `count` frames at equal distances, without those in which no marker is visible."""
    chosen = positions[np.unique(np.linspace(0, len(positions) - 1, count).round().astype(int))]
    return np.asarray(chosen[seen_in(chosen).any(axis=1)])


def _rms(distances: FloatArray, axis: int) -> FloatArray:
    """Return root mean squares along an axis, NaN without any value."""
    known = np.isfinite(distances)
    total = np.where(known, distances, 0.0) ** 2
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(total.sum(axis=axis) / known.sum(axis=axis)))
