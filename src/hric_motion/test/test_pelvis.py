"""Prior of the hips by the markers on a pelvis: the published regression, and a fit that holds it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_measured import CLEAN, NAMES, PERSON, RATE

from hric_core.geometry import FloatArray
from hric_motion.measured import measured
from hric_motion.pelvis import PELVIS, pelvis_prior


def pelvis(width: float, depth: float, back: float) -> FloatArray:
    """Return the markers on a pelvis, shape (4, 3) [m]."""
    return np.array([[depth, width, 0.0], [depth, -width, 0.0], [0.0, back, 0.0], [0.0, -back, 0.0]]) / [1.0, 2.0, 1.0]


def test_the_hips_are_where_harringtons_equations_have_them() -> None:
    """For 240 mm and 160 mm between the spines, markers 7 mm above the skin: 48.3, 82.9 and 86.5 mm."""
    positions = np.tile(pelvis(0.24, 0.174, 0.1), (3, 1, 1)) + np.arange(3.0)[:, None, None]
    positions[1, 0] = np.nan
    prior = pelvis_prior(PELVIS, positions)
    assert prior is not None and prior.hip_width == pytest.approx(2.0 * 0.0865)
    assert_allclose(prior.positions["LASI"], [0.0483 + 0.007, 0.12, 0.0829])
    assert_allclose(prior.positions["RPSI"], [0.0553 - 0.174, -0.05, 0.0829])
    assert pelvis_prior(PELVIS[:3], positions[:, :3]) is None and pelvis_prior(PELVIS, positions[1:2]) is None


def test_a_wide_pelvis_has_wide_hips() -> None:
    """The fitted hips follow the pelvis, not the height: markers 20 mm farther apart, hips 13 mm."""
    rows, shifted = [NAMES.index(name) for name in PELVIS[:2]], CLEAN.copy()
    across = CLEAN[:, rows[0]] - CLEAN[:, rows[1]]
    across *= 0.01 / np.linalg.norm(across, axis=1, keepdims=True)
    shifted[:, rows[0]] += across
    shifted[:, rows[1]] -= across
    legs = [row for row, name in enumerate(NAMES) if name[1:] not in ("THI", "KNE", "TIB", "ANK", "HEE", "TOE")]
    person = replace(PERSON, parts="upper_body")
    normal, wide = (
        measured(person, [NAMES[row] for row in legs], p[:, legs], RATE).body.subject.lengths["hip_width"]
        for p in (CLEAN, shifted)
    )
    assert wide - normal == pytest.approx(2.0 * 0.33 * 0.02, abs=0.002)
