"""Differences from a laboratory's angles: a constant one is told from one that varies, unknown angles do not count."""

import numpy as np
import pytest

from hric_motion.vendor import compared

JOINTS = ["right_knee_flex", "right_hip_abd", "neck_flex"]


def test_offset_and_varying_part_are_told_apart() -> None:
    knee = np.radians(30.0 + 20.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)))
    q = np.column_stack([knee, 0.1 - knee, knee])
    q[:5] = np.nan
    theirs = np.degrees(np.column_stack([0.9 * knee, knee, knee]))
    theirs[95:] = np.nan
    hip_row, knee_row = compared(dict(zip(JOINTS, q.T, strict=True)), {"RKneeAngles": theirs, "RHipAngles": theirs})
    assert (knee_row.joint, knee_row.theirs, knee_row.frames) == ("right_knee_flex", "RKneeAngles", 90)
    assert knee_row.offset == pytest.approx(0.1 * knee[5:95].mean())
    assert knee_row.rms == pytest.approx(np.hypot(knee_row.offset, knee_row.varying))
    assert (hip_row.joint, hip_row.offset) == ("right_hip_abd", pytest.approx(0.1))  # adduction is positive there
    assert hip_row.varying == pytest.approx(0.0, abs=1e-12)


def test_angles_that_the_file_lacks_are_not_compared() -> None:
    assert compared(dict.fromkeys(JOINTS, np.zeros(3)), {}) == []
