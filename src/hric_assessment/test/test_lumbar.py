"""The load at L5/S1 is that of worked examples, and its interval has the worst values of what is not measured."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hric_assessment.ergonomics.lumbar import LumbarLoad, level, lumbar
from hric_assessment.tables import lumbar_table
from hric_assessment.tables.base import Value


def at(moment: float, force: tuple[float, float, float], waist: float = 0.15, **values: float) -> LumbarLoad:
    """Return the load at one instant, with other values of the table."""
    table = lumbar_table()
    rows = {**table.values, **{key: Value(value=value) for key, value in values.items()}}
    return lumbar(np.array([moment]), np.array([force]), waist, replace(table, values=rows))


def test_a_published_static_lift_has_its_compression() -> None:
    """Trunk inclined by 35 deg, 510 N at 0.25 m and 150 N at 0.40 m along it, extensor at 5 cm: 3612 N and 379 N.

    Solved exercise, homeworksource.com/p/3285722.
    """
    lean = np.radians(35.0)
    moment = -(510.0 * 0.25 + 150.0 * 0.4) * np.sin(np.radians(55.0))
    load = at(moment, (-660.0 * np.sin(lean), 0.0, 660.0 * np.cos(lean)), waist=0.09, lever_arm=5.0)
    assert_allclose([load.compression[0], load.shear[0]], [3612.46, 378.56], atol=0.01)


def test_an_upright_trunk_adds_its_weight_to_the_muscle() -> None:
    load = at(-11.0, (0.0, 0.0, 400.0))
    assert_allclose(load.compression, 400.0 + 11.0 / 0.055)
    assert_allclose([load.low, load.high], [[400.0 + 11.0 / 0.06], [400.0 + 11.0 / 0.05]])


def test_a_bent_trunk_has_a_longer_lever_at_the_sacrum() -> None:
    load = at(-80.0, (-300.0, 0.0, 200.0))
    assert_allclose(load.compression, 200.0 + (80.0 + 0.06 * 300.0) / 0.055)
    assert_allclose([load.low, load.high], [[200.0 + 92.0 / 0.06], [200.0 + 104.0 / 0.05]])


def test_a_moment_that_may_vanish_may_need_no_muscle() -> None:
    assert_allclose(at(6.0, (-100.0, 0.0, 400.0)).low, 400.0)


def test_an_unknown_moment_leaves_the_compression_unknown() -> None:
    load = at(np.nan, (0.0, 0.0, 400.0))
    assert np.isnan([load.compression, load.low, load.high]).all()


@pytest.mark.parametrize(
    ("compression", "words"),
    [(3400.0, "below the NIOSH action"), (3401.0, "above the NIOSH action"), (6401.0, "above the NIOSH maximum")],
)
def test_levels_begin_beyond_the_limits(compression: float, words: str) -> None:
    assert level(compression).startswith(words)
