"""PID controller for the position or velocity of a joint."""

import pytest

from hric_control.pid import Pid, PidGains
from hric_core.errors import ParameterError


def test_a_pid_has_clamped_integral_and_effort():
    pid = Pid(PidGains(p=2.0, i=10.0, d=0.5, i_clamp=1.0), effort_limit=4.0)
    assert pid.effort(1.0, 0.01) == pytest.approx(2.0 + 0.1)
    assert pid.effort(0.9, 0.01) == pytest.approx(1.8 + 0.19 - 0.5 * 0.1 / 0.01)
    for _ in range(100):
        effort = pid.effort(0.9, 0.01)
    assert effort == pytest.approx(1.8 + 1.0)
    assert pid.effort(50.0, 0.01) == 4.0
    pid.reset()
    assert pid.effort(1.0, 0.01) == pytest.approx(2.1)


def test_p_and_d_act_on_error_and_its_rate():
    assert Pid(PidGains(p=10.0, d=2.0)).effort(0.5, 0.001, -1.0) == 3.0


def test_the_integral_does_not_wind_up():
    pid = Pid(PidGains(p=0.0, i=10.0, i_clamp=0.5))
    for _ in range(1000):
        pid.effort(1.0, 0.01)
    assert pid.effort(-1.0, 0.01) == pytest.approx(0.4)


@pytest.mark.parametrize(("error", "effort"), [(0.1, 4.0), (-0.1, -1.0 - 2.0)])
def test_each_bound_of_the_integral_can_stand_for_itself(error, effort):
    pid = Pid(PidGains(p=10.0, i=50.0, i_clamp=1.0, i_clamp_min=-2.0, i_clamp_max=3.0))
    for _ in range(1000):
        last = pid.effort(error, 0.001)
    assert last == pytest.approx(effort)


def test_a_lower_bound_above_the_upper_one_is_refused():
    with pytest.raises(ParameterError, match=r"gains/a/i_clamp_min is 3.0; valid: up to i_clamp_max, 2"):
        PidGains.of({"p": 1.0, "i_clamp_min": 3.0, "i_clamp_max": 2.0}, "gains/a")
