import numpy as np
import pytest

from franka_hw_interface.limits import FrankaLimits, franka_limits
from franka_hw_interface.rate_limits import MAX_CUTOFF, JointSmoother

T = np.arange(0.0, 4.0, 1e-3)


def limits() -> FrankaLimits:
    return franka_limits().with_margins()


def follow(wanted: np.ndarray, cutoff: float = MAX_CUTOFF) -> np.ndarray:
    """What all seven joints are sent for one wanted motion, by an arm that echoes it; shape (n, 7) [rad]."""
    smoother = JointSmoother(limits(), cutoff, positions=True)
    q, dq, ddq = [float(wanted[0])] * 7, [0.0] * 7, [0.0] * 7
    sent = []
    for u in wanted:
        new = list(smoother.smooth([float(u)] * 7, q, dq, ddq))
        velocity = [(b - a) / 1e-3 for a, b in zip(q, new, strict=True)]
        q, dq, ddq = new, velocity, [(b - a) / 1e-3 for a, b in zip(dq, velocity, strict=True)]
        sent.append(new)
    return np.array(sent)


def rates(sent: np.ndarray) -> list[np.ndarray]:
    """Return the largest velocity, acceleration and jerk of each joint."""
    padded = np.vstack([sent[:1]] * 3 + [sent])
    return [np.abs(np.diff(padded, k, axis=0)).max(axis=0) / 1e-3**k for k in (1, 2, 3)]


STRAIGHT = np.interp(T, [0.0, 0.5, 2.0, 4.0], [0.0, 0.0, 0.15, 0.15])
STEP = np.where(T < 0.2, 0.0, 0.4)
SMOOTH = 0.2 * (1.0 - np.cos(2.0 * T))


@pytest.mark.parametrize("wanted", [STRAIGHT, STEP], ids=["straight line", "step"])
@pytest.mark.parametrize("cutoff", [MAX_CUTOFF, 100.0])
def test_a_motion_with_corners_is_followed_within_the_limits_and_comes_to_rest_at_the_goal(
    wanted: np.ndarray, cutoff: float
) -> None:
    sent, own = follow(wanted, cutoff), franka_limits()
    for found, limit in zip(rates(sent), (own.velocity, own.acceleration, own.jerk), strict=True):
        assert np.all(found <= np.array(limit))
    assert np.abs(sent[-1000:] - wanted[-1]).max() < 1e-9
    assert sent.max() < wanted.max() + 2e-3


def test_a_smooth_motion_passes_unchanged() -> None:
    assert np.abs(follow(SMOOTH) - SMOOTH[:, None]).max() < 1e-12
