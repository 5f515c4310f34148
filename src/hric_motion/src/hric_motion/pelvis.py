"""Hip joint centres by the markers on a person's pelvis, as the prior of a fit.

Harrington et al. (J. Biomech. 40:595, 2007) measured in MRI how far the hip joint centres are from the middle of both
anterior iliac spines, by the distance of these spines (width) and their distance from the posterior ones (depth). The
paper was not opened: its equations with one variable and its leave-one-out errors come from public transcriptions.
Mantovani et al. (Gait Posture 44:48, 2016) found 12 mm between these centres and those of 67 people in CT.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hric_core.geometry import FloatArray

BEHIND, OUTWARD, BELOW = (0.24, 0.0099), (0.33, 0.0073), (0.30, 0.0109)
"""Hip joint centre behind (times depth), outside and below (times width) the anterior spines: factor, offset [m]."""
ERROR = (0.00524, 0.00322, 0.00358)
"""Leave-one-out errors of these equations forward, outward and up [m]."""
CERTAINTY = 0.5
"""Ratio of the prior standard deviation to these errors (project default, unconfirmed).

Below 1, since the fit counts frames as independent, but skin that moves with the joint moves alike in each step: in a
walk, a residual that is lower by 0.05 mm had moved a hip 30 mm outward.
"""
MARKER_RADIUS = 0.007
"""Distance from the skin to the centre of a marker [m]: half of 14 mm, which files do not state; unconfirmed."""
PELVIS = ("LASI", "RASI", "LPSI", "RPSI")
"""Markers on the iliac spines: anterior ones, posterior ones."""


class PelvisPrior(NamedTuple):
    """Prior of the hips, relative to the markers on a pelvis.

    Attributes:
        hip_width: distance of the hip joint centres [m].
        positions: positions of the markers, from the middle of the hip joint centres in axes of the pelvis, shape (3,)
            [m].
        width_spread: prior standard deviation of the logarithm of the hip width [1].
        spread: prior standard deviations of the positions, shape (3,) [m].
    """

    hip_width: float
    positions: Mapping[str, FloatArray]
    width_spread: float
    spread: FloatArray


def pelvis_prior(names: Sequence[str], positions: FloatArray) -> PelvisPrior | None:
    """Return the prior of the hips; None: no frame shows all four markers.

    Args:
        names: names of the markers.
        positions: positions of the markers, shape (n, m, 3) [m]; NaN: not visible.
    """
    if not set(PELVIS) <= set(names):
        return None
    spines = positions[:, [names.index(name) for name in PELVIS]]
    left, right, left_back, right_back = spines[np.isfinite(spines).all(axis=(1, 2))].swapaxes(0, 1)
    if not len(left):
        return None
    width, back = _median(left - right), _median(left_back - right_back)
    depth = _median(left + right - left_back - right_back) / 2.0
    forward = BEHIND[0] * (depth - 2.0 * MARKER_RADIUS) + BEHIND[1] + MARKER_RADIUS
    up, hip_width = BELOW[0] * width + BELOW[1], 2.0 * (OUTWARD[0] * width + OUTWARD[1])
    corners = ((forward, width), (forward, -width), (forward - depth, back), (forward - depth, -back))
    on_pelvis = {name: np.array([x, y / 2.0, up]) for name, (x, y) in zip(PELVIS, corners, strict=True)}
    return PelvisPrior(hip_width, on_pelvis, CERTAINTY * 2.0 * ERROR[1] / hip_width, CERTAINTY * np.array(ERROR))


def _median(differences: FloatArray) -> float:
    """Return the median length of vectors, shape (n, 3) [m]."""
    return float(np.median(np.linalg.norm(differences, axis=1)))
