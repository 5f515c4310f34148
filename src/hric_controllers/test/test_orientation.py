import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hric_controllers import orientation


def test_the_angular_velocity_is_that_of_the_rotation_itself():
    rng = np.random.default_rng(2)
    for size in (0.0, 1e-5, 1e-3, 0.5, 2.5):
        v, rate, dt = size * rng.normal(size=3), rng.normal(size=3), 1e-5
        before, after = Rotation.from_rotvec(v - 0.5 * dt * rate), Rotation.from_rotvec(v + 0.5 * dt * rate)
        numeric = (after * before.inv()).as_rotvec() / dt
        assert orientation.angular_velocity(tuple(v), tuple(rate)) == pytest.approx(numeric, abs=1e-7)


def test_a_vector_is_rotated_as_by_an_independent_library():
    rng = np.random.default_rng(3)
    for _ in range(20):
        R, v = Rotation.random(random_state=rng), rng.normal(size=3)
        assert orientation.rotated(tuple(R.as_quat()), tuple(v)) == pytest.approx(R.apply(v), abs=1e-12)
