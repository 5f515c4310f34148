"""Controllers that act on the external wrench, on the simulated arm: an unknown wrench ends them; a start outside."""

import logging
import math

import numpy as np
import pytest
from arm_rig import ArmRig


@pytest.mark.parametrize("name", ["admittance_controller", "force_controller"])
@pytest.mark.parametrize("begin", [0.1, 1.0], ids=["during the tare", "while a hand leads the arm"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_wrench_that_is_not_finite_stops_the_controller_and_the_arm(
    name: str, begin: float, value: float, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, poses = ArmRig(name), []
    still = (0.0, 0.0, 0.0)
    rig.hw.plant.apply_wrench("panda_link7", (0.0, 12.0, 0.0), still, still, 5.0)
    read = rig.hw.read

    def faulty(time: float, period: float) -> None:
        read(time, period)
        if time >= begin:
            rig.state.O_F_ext_hat_K = [0.0, value, 0.0, 0.0, 0.0, 0.0]

    monkeypatch.setattr(rig.hw, "read", faulty)
    rig.run(2.0, lambda time: poses.append(rig.state.O_T_EE[12:15]))
    path = np.array(poses)
    assert np.isfinite(path).all()
    errors = [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]
    assert len(errors) == 1 and "the estimated external wrench (O_F_ext_hat_K) is not finite" in errors[0]
    assert rig.hw.error == ""
    assert {c.name: c.state for c in rig.manager.list()}[name] != "running"
    assert np.abs(path[-1] - path[-500]).max() < 1e-3
    assert np.linalg.norm(path[-1] - path[int(begin * 1e3)]) < 0.05


def test_an_admittance_that_starts_outside_its_workspace_waits_for_a_push() -> None:
    bench = ArmRig("admittance_controller", workspace={"lower": [-0.85, -0.85, 0.02], "upper": [0.85, 0.85, 0.3]})
    before = list(bench.state.O_T_EE_c[12:15])
    bench.run(1.0)
    assert np.abs(np.subtract(bench.state.O_T_EE_c[12:15], before)).max() < 1e-6
    bench.hw.plant.apply_wrench("panda_link7", (0.0, 0.0, -20.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    bench.run(1.0)
    assert bench.state.O_T_EE_c[14] < before[2] - 0.02
