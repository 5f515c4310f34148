"""Masses of the flange in random poses: by the project and by an independent library."""

import numpy as np
import pytest
from flange_mass import LOCKED, FlangeMasses


@pytest.mark.parametrize("inertials", ["barycentric", "fr3"])
def test_all_masses_agree_with_pinocchio(inertials: str) -> None:
    flange = FlangeMasses(inertials, 50)
    other = flange.library()
    for name, mass in flange.own().items():
        np.testing.assert_allclose(mass, other[name], rtol=1e-9, err_msg=name)


def test_published_rotors_and_locked_joints_exceed_0_1() -> None:
    median = {name: float(np.median(mass)) for name, mass in FlangeMasses(count=300).library().items()}
    assert median["0.1 kg m^2 each"] < 0.8 * median["published rotors"] < median[LOCKED]
