"""The model against logs whose truth is known: an independent simulation with known friction, and logs that nobody
should compare."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import simulated_arm_log as simulated
from simulated_arm_log import FRICTION, LOAD_COM, LOAD_INERTIA, sigmoid

import panda_description
from franka_hw_interface.arm_log import ArmLog, LogError, check_log
from franka_hw_interface.friction_file import friction_text, read_friction, read_parameters
from franka_hw_interface.friction_fit import JointFriction, fit_friction
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.log_signals import condition
from franka_hw_interface.model_check import ModelCheck, check, inverse_dynamics
from hric_control.plants import bristle_torque
from hric_core.errors import ParameterError

NAMES = tuple(f"panda_joint{i}" for i in range(1, 8))
COLUMNS = ("t", *(f"{name}{i}" for name in ("q", "dq", "tau") for i in range(1, 8)))
PUBLISHED = [(phi["phi1"], phi["phi2"], phi["phi3"]) for phi in panda_description.friction_parameters().values()]
KNOWN = [tuple(phi) for phi in FRICTION.tolist()]
BREAKAWAY = [0.3, 0.5, 0.2, 0.4, 0.15, 0.1, 0.05]


@pytest.fixture(scope="module")
def urdf() -> str:
    return panda_description.load(meshes=False, collision=False)


@pytest.fixture
def model(urdf: str) -> KdlFrankaModel:
    return KdlFrankaModel(urdf, "panda")


@pytest.fixture(scope="module")
def log(urdf: str) -> ArmLog:
    return as_log(simulated.simulate(urdf))


def as_log(data: simulated.Simulated) -> ArmLog:
    return ArmLog(NAMES, data.time, data.q, data.dq, data.tau, COLUMNS, np.arange(len(data.time)) + 2, "line")


def compared(model: KdlFrankaModel, log: ArmLog, friction: list | None = None) -> ModelCheck:
    check_log(log, franka_limits().lower, franka_limits().upper)
    return check(model, NAMES, condition(log), friction)


def curve_error(fit: JointFriction, phi: np.ndarray) -> float:
    """Largest error of the fitted friction torque over the velocities that the log has, relative to the largest
    friction torque."""
    velocity = np.linspace(*fit.speeds, 500)
    truth = sigmoid(velocity, phi)
    return float(np.abs(sigmoid(velocity, np.array(fit.phi)) - truth).max() / np.abs(truth).max())


def test_inverse_dynamics_is_that_of_a_second_library(urdf: str, model: KdlFrankaModel) -> None:
    other, rng = pin.buildModelFromXML(urdf), np.random.default_rng(1)
    data = other.createData()
    q, dq, ddq = (rng.uniform(-2.0, 2.0, (50, 7)) for _ in range(3))
    expected = np.array([pin.rnea(other, data, *row) for row in zip(q, dq, ddq, strict=True)])
    assert np.abs(inverse_dynamics(model, q, dq, ddq) - expected).max() < 1e-10


def test_the_fit_recovers_known_friction_within_five_percent(model: KdlFrankaModel, log: ArmLog) -> None:
    fits = fit_friction(compared(model, log), PUBLISHED)
    errors = [curve_error(fit, phi) for fit, phi in zip(fits, FRICTION, strict=True)]
    found = np.array([fit.phi for fit in fits])
    print("\nlargest error of the friction torque, of its maximum:", " ".join(f"{error:.4f}" for error in errors))
    print("phi1, phi2 relative to the truth:", (found[:, :2] / FRICTION[:, :2]).round(3).tolist())
    assert all(fit.fitted and not fit.loose() for fit in fits)
    assert max(errors) < 0.05
    assert np.abs(found[:, :2] / FRICTION[:, :2] - 1.0).max() < 0.05
    # phi3 moves the bend of the curve, whose width is 1/phi2.
    assert np.abs((found[:, 2] - FRICTION[:, 2]) * FRICTION[:, 1]).max() < 0.05


def test_so_with_the_noise_of_a_real_arm_and_a_clock_that_jitters_and_loses_samples(
    model: KdlFrankaModel, log: ArmLog
) -> None:
    rng = np.random.default_rng(2)
    kept = np.sort(rng.choice(len(log.time), round(0.9 * len(log.time)), replace=False))
    noisy = ArmLog(
        NAMES,
        (log.time + rng.uniform(-2e-4, 2e-4, len(log.time)))[kept],
        *(
            (values + rng.normal(0.0, noise, values.shape))[kept]
            for values, noise in ((log.q, 3e-4), (log.dq, 6e-3), (log.tau, 0.1))
        ),
        COLUMNS,
        log.rows[kept],
        "line",
    )
    fits = fit_friction(compared(model, noisy), PUBLISHED)
    errors = [curve_error(fit, phi) for fit, phi in zip(fits, FRICTION, strict=True)]
    print("\nlargest error of the friction torque, of its maximum:", " ".join(f"{error:.4f}" for error in errors))
    assert max(errors) < 0.05


def test_the_fit_finds_the_breakaway_of_joints_that_stick(model: KdlFrankaModel, log: ArmLog) -> None:
    stuck = np.column_stack([bristle_torque(column, log.time) for column in log.dq.T]) * BREAKAWAY
    sticking = ArmLog(NAMES, log.time, log.q, log.dq, log.tau + stuck, COLUMNS, log.rows, "line")
    fits = fit_friction(compared(model, sticking), PUBLISHED)
    assert np.abs(np.array([fit.breakaway for fit in fits]) - BREAKAWAY).max() < 0.05
    assert max(curve_error(fit, phi) for fit, phi in zip(fits, FRICTION, strict=True)) < 0.05
    signals = condition(sticking)
    left = [check(model, NAMES, signals, KNOWN, breakaway=held).rms.sum() for held in ((), BREAKAWAY)]
    assert left[1] < 0.1 < 0.5 * left[0]


def test_with_the_true_friction_nothing_is_left_and_without_it_friction_is(model: KdlFrankaModel, log: ArmLog) -> None:
    without, true = compared(model, log), compared(model, log, KNOWN)
    assert true.rms.max() < 0.02
    friction = np.sqrt(np.mean(sigmoid(without.velocity, FRICTION) ** 2, axis=0))
    assert np.abs(without.rms / friction - 1.0).max() < 0.05


def test_the_load_that_the_arm_carried_belongs_to_the_model(urdf: str, model: KdlFrankaModel) -> None:
    loaded = as_log(simulated.simulate(urdf, 4.0, load=1.5))
    assert compared(model, loaded, KNOWN).rms.sum() > 3.0
    model.set_load(1.5, LOAD_COM, LOAD_INERTIA)
    assert compared(model, loaded, KNOWN).rms.max() < 0.02


def test_a_joint_that_hardly_moved_keeps_its_friction_and_says_so(
    urdf: str, model: KdlFrankaModel, tmp_path: Path
) -> None:
    fits = fit_friction(compared(model, as_log(simulated.simulate(urdf, 6.0, still=(4,)))), PUBLISHED)
    assert [fit.fitted for fit in fits] == [True, True, True, True, False, True, True]
    assert fits[4].phi == PUBLISHED[4] and fits[4].rms == fits[4].rms_before
    text = friction_text(fits, ("of a test",))
    (line,) = [line for line in text.splitlines() if line.startswith("panda_joint5")]
    assert "NOT FITTED" in line and "does not determine friction; values as before" in line
    assert "NOT FITTED" not in text.replace(line, "")
    path = tmp_path / "friction.yaml"
    path.write_text(text)
    assert np.abs(np.array(read_friction(path)) - [fit.phi for fit in fits]).max() < 1e-6


def test_a_joint_that_moved_one_way_only_is_not_fitted(model: KdlFrankaModel, log: ArmLog) -> None:
    signals = condition(log)
    signals.dq[:, 6] = np.abs(signals.dq[:, 6])
    assert [fit.fitted for fit in fit_friction(check(model, NAMES, signals), PUBLISHED)] == [True] * 6 + [False]


def changed(**change: Callable[[np.ndarray], np.ndarray]) -> Callable[[ArmLog], ArmLog]:
    return lambda log: replace(log, **{name: function(getattr(log, name)) for name, function in change.items()})


def with_value(k: int, j: int, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def put(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[k, j] = value
        return values

    return put


def cut(log: ArmLog, kept: np.ndarray | slice) -> ArmLog:
    return replace(log, **{name: getattr(log, name)[kept] for name in ("time", "q", "dq", "tau", "rows")})


REFUSALS = {
    "NaN": (changed(tau=with_value(5, 2, np.nan)), "line 7, column tau3 is nan; each value must be finite"),
    "infinite": (changed(dq=with_value(0, 0, -np.inf)), "line 2, column dq1 is -inf; each value must be finite"),
    "time stands": (
        changed(time=lambda t: np.where(np.arange(len(t)) == 9, t[8], t)),
        "time does not increase: t is 0.008 in line 11 after 0.008",
    ),
    "time back": (
        changed(time=lambda t: t[::-1]),
        "time does not increase: t is 11.998 in line 3 after 11.999 in line 2",
    ),
    "milliseconds": (changed(time=lambda t: 1e3 * t), "the time looks like milliseconds; seconds are needed"),
    "microseconds": (changed(time=lambda t: 1e6 * t), "the time looks like microseconds"),
    "nanoseconds since 1970": (changed(time=lambda t: 1.7e18 + 1e9 * t), "the time looks like nanoseconds"),
    "degrees": (
        changed(q=np.rad2deg, dq=np.rad2deg),
        r"line \d+: q\d is .*ranges from .*; the positions look like degrees; radians are needed",
    ),
    "degrees per second": (changed(dq=np.rad2deg), "the velocities look like degrees per second; rad/s are needed"),
    "far outside": (
        changed(q=lambda q: q + 3.0),
        "but panda_joint4 ranges from -3.072 to -0.0698 rad; are these the joint positions",
    ),
    "columns exchanged": (changed(dq=lambda dq: dq[:, [1, 0, 2, 3, 4, 5, 6]]), "dq1 is not the derivative of q1"),
    "sign": (
        changed(dq=lambda dq: dq * [1, 1, 1, -1, 1, 1, 1]),
        "dq4 is not the derivative of q4: q4 changes -1 times as fast",
    ),
    "millinewton metres": (
        changed(tau=lambda tau: 1e3 * tau),
        "the measured torque is 998 times what the motion needs: .* in N m",
    ),
    "short": (
        lambda log: cut(log, slice(0, 2500)),
        "the log is too short: 2.5 s; 2.6 s are needed, of which the filter takes 0.3 s at each end",
    ),
    "one sample": (lambda log: cut(log, slice(0, 1)), "the log has 1 samples"),
    "slow": (
        lambda log: cut(log, slice(None, None, 50)),
        "the log has 20 samples per second; a cut-off of 10 Hz needs 50 or more",
    ),
    "gap": (
        lambda log: cut(log, np.r_[0:4000, 4200:12000]),
        "0.201 s are missing between line 4001 and line 4202, at 3.999 s",
    ),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_a_log_that_cannot_be_compared_is_refused_in_one_line(model: KdlFrankaModel, log: ArmLog, name: str) -> None:
    change, said = REFUSALS[name]
    with pytest.raises(LogError, match=said) as error:
        compared(model, change(log))
    assert "\n" not in str(error.value)


def test_a_commanded_torque_without_gravity_is_refused(urdf: str, model: KdlFrankaModel, log: ArmLog) -> None:
    gravity = np.array([model.gravity(q) for q in log.q])
    with pytest.raises(LogError, match="is it a commanded torque, without gravity"):
        compared(model, replace(log, tau=log.tau - gravity))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: [", "is not YAML"),
        ("- 1", "must map joints to phi1, phi2 and phi3"),
        ("panda_joint8: {phi1: 1, phi2: 1, phi3: 0}", "has panda_joint8; valid: joint1, joint2"),
        ("joint1: {phi1: 1, phi2: 1, phi3: 0}\npanda_joint1: {phi1: 1, phi2: 1, phi3: 0}", "has a joint twice"),
        (
            "".join(f"joint{i}: {{phi1: 1, phi2: 1, phi3: 0}}\n" for i in (1, 2, 4, 5, 6, 7)),
            "phi3 of joint1 to joint7; missing: joint3",
        ),
        ("".join(f"joint{i}: {{phi1: 1, phi2: .nan, phi3: 0}}\n" for i in range(1, 8)), "must give finite numbers"),
        (
            "".join(f"joint{i}: {{phi1: 1, phi2: 1, phi3: 0, breakaway: -1}}\n" for i in range(1, 8)),
            "breakaway, if present, must not be negative",
        ),
        ("{phi1: [1, 2], phi2: [1, 2], phi3: [0, 0]}", "must give finite numbers phi1, phi2 and phi3"),
    ],
)
def test_a_friction_file_that_cannot_be_used_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "friction.yaml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=said) as error:
        read_friction(path)
    assert "\n" not in str(error.value)


def test_a_friction_file_may_have_lists_and_any_prefix(tmp_path: Path) -> None:
    path = tmp_path / "friction.yaml"
    path.write_text(
        f"phi1: {FRICTION[:, 0].tolist()}\nphi2: {FRICTION[:, 1].tolist()}\nphi3: {FRICTION[:, 2].tolist()}\n"
    )
    assert read_friction(path) == KNOWN
    assert "breakaway" not in read_parameters(path)
    path.write_text(path.read_text() + f"breakaway: {BREAKAWAY}\n")
    assert read_parameters(path)["breakaway"] == BREAKAWAY
    path.write_text(
        "".join(f"left_joint{i + 1}: {{phi1: {a}, phi2: {b}, phi3: {c}}}\n" for i, (a, b, c) in enumerate(KNOWN))
    )
    assert read_friction(path) == KNOWN
