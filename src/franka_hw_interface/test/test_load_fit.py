"""Identification of a payload from logs of an independent simulation with friction, whose payload is known."""

from dataclasses import replace

import numpy as np
import pytest
import simulated_arm_log as simulated
from simulated_arm_log import LOAD_COM, LOAD_INERTIA

import panda_description
from franka_hw_interface.arm_log import ArmLog, LogError
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.load_fit import fit_load
from franka_hw_interface.log_signals import condition
from franka_hw_interface.model_check import ModelCheck, check

NAMES = tuple(f"panda_joint{i}" for i in range(1, 8))
MASS, DURATION = 1.5, 12.0


@pytest.fixture(scope="module")
def urdf() -> str:
    return panda_description.load(meshes=False, collision=False)


@pytest.fixture(scope="module")
def logs(urdf: str) -> tuple[ArmLog, ArmLog]:
    """Return logs with the payload and without it."""
    return as_log(simulated.simulate(urdf, DURATION, load=MASS)), as_log(simulated.simulate(urdf, DURATION))


@pytest.fixture
def model(urdf: str) -> KdlFrankaModel:
    return KdlFrankaModel(urdf, "panda")


def as_log(data: simulated.Simulated) -> ArmLog:
    return ArmLog(NAMES, data.time, data.q, data.dq, data.tau, (), np.arange(len(data.time)) + 2, "line")


def compared(model: KdlFrankaModel, log: ArmLog) -> ModelCheck:
    return check(model, NAMES, condition(log))


def test_mass_centre_and_inertia_are_those_of_the_simulation(
    model: KdlFrankaModel, logs: tuple[ArmLog, ArmLog]
) -> None:
    loaded, empty = (compared(model, log) for log in logs)
    fit = fit_load(model, loaded, empty)
    assert fit.mass == pytest.approx(MASS, rel=0.002)
    np.testing.assert_allclose(fit.com, LOAD_COM, atol=1e-3)
    assert fit.inertia is not None
    np.testing.assert_allclose(fit.inertia, LOAD_INERTIA, atol=1.5e-3)
    assert model.load.mass == 0.0


def test_the_start_of_the_second_log_does_not_matter(model: KdlFrankaModel, logs: tuple[ArmLog, ArmLog]) -> None:
    late = replace(logs[1], time=logs[1].time + 100.37)
    fits = [fit_load(model, compared(model, logs[0]), compared(model, empty)) for empty in (logs[1], late)]
    assert fits[1].shift == pytest.approx(fits[0].shift - 100.37, abs=1e-6)
    assert fits[1].mass == pytest.approx(fits[0].mass, abs=1e-5)


def test_an_error_of_the_arms_model_cancels(model: KdlFrankaModel, logs: tuple[ArmLog, ArmLog], urdf: str) -> None:
    wrong = KdlFrankaModel(panda_description.load(meshes=False, collision=False, hand=False), "panda")
    fit = fit_load(wrong, *(compared(wrong, log) for log in logs))
    assert fit.mass == pytest.approx(MASS, rel=0.005)


def test_different_motions_are_refused(model: KdlFrankaModel, logs: tuple[ArmLog, ArmLog], urdf: str) -> None:
    other = as_log(simulated.simulate(urdf, DURATION, still=(4,)))
    with pytest.raises(LogError, match=r"the two logs have different motions: panda_joint5 differs by .* rad RMS"):
        fit_load(model, compared(model, logs[0]), compared(model, other))


def test_an_arm_at_rest_is_refused(model: KdlFrankaModel, urdf: str) -> None:
    still = as_log(simulated.simulate(urdf, 4.0, still=tuple(range(7))))
    with pytest.raises(LogError, match=r"the joints exceed 0\.1 rad/s for only 0 s; valid: 2 s or more"):
        fit_load(model, compared(model, still), compared(model, still))


@pytest.mark.parametrize("order", [(1, 0), (1, 1)])
def test_logs_without_a_payload_in_the_first_are_refused(
    order: tuple[int, int], model: KdlFrankaModel, logs: tuple[ArmLog, ArmLog]
) -> None:
    with pytest.raises(LogError, match=r"the mass is -?[0-9.]+ \+- .* kg; valid: above 3 standard deviations"):
        fit_load(model, *(compared(model, logs[i]) for i in order))
