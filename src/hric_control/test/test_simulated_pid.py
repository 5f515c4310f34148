"""The PID by which a joint of the simulated robot follows a position or velocity."""

import pytest

from hric_control.sim.pid import Pid, PidGains


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
