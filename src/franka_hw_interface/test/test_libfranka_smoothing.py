"""The limiter and the low-pass against libfranka's own, which the Panda's binding lets one call."""

import math

import numpy as np
import panda_py.libfranka
import pytest

from franka_hw_interface.limits import fr3_limits
from franka_hw_interface.rate_limits import JointSmoother, TorqueSmoother, gain

LIMITS = fr3_limits()
NONE = 1000.0


def test_the_torque_limiter_does_what_libfrankas_does() -> None:
    generator = np.random.default_rng(1)
    for _ in range(200):
        wanted, last = (generator.uniform(-5.0, 5.0, 7).tolist() for _ in range(2))
        expected = panda_py.libfranka.limit_rate(panda_py.libfranka.MAX_TORQUE_RATE, wanted, last)
        assert TorqueSmoother(LIMITS, NONE).smooth(wanted, last) == pytest.approx(expected, abs=1e-12)


def test_the_low_pass_weighs_as_libfranka_documents_and_not_at_all_from_1000_hz_on() -> None:
    assert gain(100.0) == pytest.approx(0.001 / (0.001 + 1.0 / (2.0 * math.pi * 100.0)))
    assert gain(1000.0) == gain(5000.0) == 1.0
    smoothed = TorqueSmoother(None, 100.0).smooth([1.0] * 7, [0.0] * 7)
    assert smoothed == pytest.approx([gain(100.0)] * 7)


def test_without_limits_and_filter_a_torque_goes_as_it_is() -> None:
    assert TorqueSmoother(None, NONE).smooth([50.0] * 7, [0.0] * 7) == [50.0] * 7


def test_an_echo_in_single_precision_costs_no_accuracy_but_a_lost_command_counts() -> None:
    smoother = TorqueSmoother(LIMITS, NONE)
    first = smoother.smooth([50.0] * 7, [0.0] * 7)
    second = smoother.smooth([50.0] * 7, np.float32(first).tolist())
    assert second == pytest.approx([2 * 0.999999] * 7, abs=1e-12)
    assert smoother.smooth([50.0] * 7, [0.999999] * 7) == pytest.approx([2 * 0.999999] * 7, abs=1e-12)


def rates(values: list[float]) -> tuple[float, float, float]:
    """Largest velocity, acceleration and jerk of positions a millisecond apart, the arm having stood before."""
    padded = np.array([values[0]] * 3 + values)
    return tuple(float(np.abs(np.diff(padded, n)).max() / 0.001**n) for n in (1, 2, 3))  # type: ignore[return-value]


@pytest.mark.parametrize("cutoff", [NONE, 100.0])
def test_a_jump_of_a_position_becomes_a_motion_within_the_limits_that_gets_there(cutoff) -> None:
    smoother, goal = JointSmoother(LIMITS, cutoff, positions=True), 0.5
    q, dq, ddq = [0.0] * 7, [0.0] * 7, [0.0] * 7
    path = [0.0]
    for _ in range(3000):
        new = smoother.smooth([goal] * 7, q, dq, ddq)
        v = [(a - b) / 0.001 for a, b in zip(new, q, strict=True)]
        q, dq, ddq = new, v, [(a - b) / 0.001 for a, b in zip(v, dq, strict=True)]
        path.append(new[0])
    velocity, acceleration, jerk = rates(path)
    assert (
        velocity <= LIMITS.velocity[0]
        and acceleration <= LIMITS.acceleration[0] + 1e-6
        and jerk <= LIMITS.jerk[0] + 1e-3
    )
    assert max(path) > goal * 0.99


def test_a_jump_of_a_velocity_becomes_a_ramp_within_the_limits() -> None:
    smoother, path = JointSmoother(LIMITS, NONE, positions=False), [0.0]
    dq, ddq = [0.0] * 7, [0.0] * 7
    for _ in range(500):
        new = smoother.smooth([1.0] * 7, [0.0] * 7, np.float32(dq).tolist(), np.float32(ddq).tolist())
        dq, ddq = new, [(a - b) / 0.001 for a, b in zip(new, dq, strict=True)]
        path.append(path[-1] + 0.001 * new[0])
    _, acceleration, jerk = rates(path)
    assert acceleration <= LIMITS.acceleration[0] + 1e-6 and jerk <= LIMITS.jerk[0] + 1e-2
    assert dq == pytest.approx([1.0] * 7, abs=1e-3)


def test_a_slow_motion_passes_unchanged() -> None:
    smoother = JointSmoother(LIMITS, NONE, positions=True)
    q = dq = ddq = [0.0] * 7
    for n in range(1, 300):
        wanted = [0.05 * (1.0 - math.cos(2.0 * math.pi * n / 1000.0))] * 7
        new = smoother.smooth(wanted, q, dq, ddq)
        v = [(a - b) / 0.001 for a, b in zip(new, q, strict=True)]
        q, dq, ddq = new, v, [(a - b) / 0.001 for a, b in zip(v, dq, strict=True)]
        assert new == pytest.approx(wanted, abs=1e-9)
