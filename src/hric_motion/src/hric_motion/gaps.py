"""Short gaps of markers, filled by cubic splines, as is usual before inverse kinematics."""

import numpy as np
from scipy.interpolate import CubicSpline

from hric_core.geometry import FloatArray
from hric_human.tracking.tracker import BRIDGE


def bridged(positions: FloatArray, rate: float) -> FloatArray:
    """Return marker positions in which gaps of at most BRIDGE between two visible frames are filled.

    Args:
        positions: positions of the markers, shape (n, m, 3) [m]; NaN: not visible.
        rate: rate of the frames [Hz].
    """
    filled, frames = positions.copy(), np.arange(len(positions))
    for marker in range(positions.shape[1]):
        seen = np.flatnonzero(np.isfinite(positions[:, marker]).all(axis=1))
        if len(seen) < 4 or len(seen) == len(frames):
            continue
        hole = np.diff(seen)
        short = np.repeat((hole > 1) & (hole <= BRIDGE * rate + 1e-9), np.maximum(hole - 1, 0))
        missing = np.setdiff1d(frames[seen[0] : seen[-1]], seen)[short]
        filled[missing, marker] = CubicSpline(seen, positions[seen, marker])(missing)
    return filled
