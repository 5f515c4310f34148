"""The internal impedances follow q_d and are stable at 1 kHz."""

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotState
from franka_sim.box.config import motion_parameters
from franka_sim.box.internal_impedance import CartesianImpedanceLaw, JointImpedanceLaw, defaults
from franka_sim.box.motion import make_generator
from franka_sim.box.requests import GeneratorMode, MotionCommand
from hric_core.errors import CommandError

READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
LIMITS = franka_limits()
DT = 0.001


@pytest.fixture
def model() -> KdlFrankaModel:
    return KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda")


def state_at(
    q: np.ndarray, q_d: np.ndarray, dq: np.ndarray | None = None, dq_d: np.ndarray | None = None
) -> RobotState:
    state = RobotState()
    state.q[:], state.q_d[:] = q.tolist(), q_d.tolist()
    state.dq[:] = np.zeros(7).tolist() if dq is None else dq.tolist()
    state.dq_d[:] = np.zeros(7).tolist() if dq_d is None else dq_d.tolist()
    return state


def gains_by_differences(
    law: JointImpedanceLaw | CartesianImpedanceLaw, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """-d tau / d q and -d tau / d dq around rest at q."""
    h, one = 1e-5, np.eye(7)
    by_q = [np.subtract(law.torque(state_at(q - h * e, q)), law.torque(state_at(q + h * e, q))) for e in one]
    by_v = [np.subtract(law.torque(state_at(q, q, dq=-h * e)), law.torque(state_at(q, q, dq=h * e))) for e in one]
    return np.array(by_q).T / (2 * h), np.array(by_v).T / (2 * h)


def radius(M: np.ndarray, K: np.ndarray, D: np.ndarray) -> float:
    """Largest eigenvalue by magnitude of M ddq = -K q - D dq with the torque held over each time step."""
    a, b, one = np.linalg.solve(M, K), np.linalg.solve(M, D), np.eye(7)
    return float(
        np.abs(
            np.linalg.eigvals(np.block([[one - DT**2 / 2 * a, DT * one - DT**2 / 2 * b], [-DT * a, one - DT * b]]))
        ).max()
    )


@pytest.mark.parametrize("law_type", [JointImpedanceLaw, CartesianImpedanceLaw])
@pytest.mark.parametrize("rotor_inertia", [0.1, 0.0])
def test_each_law_is_stable_at_1_khz_over_legal_poses_with_and_without_payload(model, law_type, rotor_inertia) -> None:
    law = law_type(model, LIMITS, [rotor_inertia] * 7, DT)
    worst = 0.0
    for load in (0.0, 3.0):
        model.set_load(load, [0.0, 0.0, 0.1], np.eye(3) * 0.01)
        for q in np.random.default_rng(7).uniform(LIMITS.lower, LIMITS.upper, (150, 7)):
            if np.linalg.svd(model.zero_jacobian(FrankaFrame.STIFFNESS, q))[1][-1] < motion_parameters().singular_value:
                continue
            worst = max(worst, radius(model.mass(q) + rotor_inertia * np.eye(7), *gains_by_differences(law, q)))
    assert worst < 1.0


@pytest.mark.parametrize("rotors", [panda_description.rotor_inertia(), [0.1] * 7], ids=["published", "light"])
def test_the_cartesian_law_damps_each_mode_critically_in_each_pose(model, rotors) -> None:
    law = CartesianImpedanceLaw(model, LIMITS, rotors, DT)
    for q in (READY, READY + 0.3, READY + np.array([0.5, 0.4, -0.3, 0.6, 0.2, -0.5, 1.0])):
        K, D = gains_by_differences(law, q)
        M = model.mass(q) + np.diag(rotors)
        # Critical damping of all modes: D M^-1 D = 4 K.
        np.testing.assert_allclose(D @ np.linalg.solve(M, D), 4.0 * K, rtol=1e-3, atol=1e-3 * np.abs(K).max())


def test_the_default_cartesian_stiffness_needs_no_lowering_with_rotor_inertia(model) -> None:
    rotors = panda_description.rotor_inertia()
    assert CartesianImpedanceLaw(model, LIMITS, rotors, DT).stiffness == defaults()["cartesian_stiffness"]
    assert max(CartesianImpedanceLaw(model, LIMITS, [0.0] * 7, DT).stiffness[3:]) < 300.0


def test_the_joint_law_is_a_spring_and_a_damper_on_each_joint(model) -> None:
    law = JointImpedanceLaw(model, LIMITS, [0.1] * 7, DT)
    law.set_stiffness([600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0])
    K, D = gains_by_differences(law, READY)
    np.testing.assert_allclose(K, np.diag([600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0]), atol=1e-4)
    np.testing.assert_allclose(D, np.diag(law.damping), atol=1e-4)
    assert law.damping[0] < defaults()["damping"][0] * (600.0 / 3000.0) ** 0.5 + 1e-9


def test_the_cartesian_law_gives_the_wrench_of_its_stiffness_in_the_axes_of_the_stiffness_frame(model) -> None:
    a = 0.3
    T = np.array(
        [
            [np.cos(a), -np.sin(a), 0.0, 0.02],
            [np.sin(a), np.cos(a), 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.05],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    model.set_stiffness_frame(T)
    law = CartesianImpedanceLaw(model, LIMITS, [0.1] * 7, DT)
    law.set_stiffness([1000.0, 500.0, 200.0, 30.0, 20.0, 10.0])
    J = model.body_jacobian(FrankaFrame.STIFFNESS, READY)
    dq = np.linalg.pinv(J) @ [1e-5, -2e-5, 3e-5, 1e-5, 2e-5, -1e-5]
    tau = law.torque(state_at(READY, READY + dq))
    np.testing.assert_allclose(tau, J.T @ [0.01, -0.01, 0.006, 3e-4, 4e-4, -1e-4], atol=2e-6)


def test_a_force_does_not_move_the_elbow_spring_and_the_elbow_spring_makes_no_force(model) -> None:
    law = CartesianImpedanceLaw(model, LIMITS, [0.1] * 7, DT)
    J = model.zero_jacobian(FrankaFrame.STIFFNESS, READY)
    null = np.linalg.svd(J)[2][-1]
    tau = np.array(law.torque(state_at(READY, READY + 1e-5 * null)))
    assert np.linalg.norm(tau) == pytest.approx(1e-5 * defaults()["self_motion_stiffness"], rel=1e-3)
    # tau = J' F has no other solution than F = 0.
    assert np.abs(np.linalg.pinv(J.T) @ tau).max() < 1e-5


@pytest.mark.parametrize("law_type", [JointImpedanceLaw, CartesianImpedanceLaw])
def test_a_law_keeps_the_torque_limits_and_follows_without_torque_what_moves_as_desired(model, law_type) -> None:
    law = law_type(model, LIMITS, [0.1] * 7, DT)
    dq = np.linspace(-0.3, 0.3, 7)
    assert np.abs(law.torque(state_at(READY, READY, dq, dq))).max() < 1e-12
    torque = np.abs(law.torque(state_at(READY, READY + 0.9)))
    assert (torque <= LIMITS.effort).all() and (torque == LIMITS.effort).any()


@pytest.mark.parametrize(
    ("law_type", "stiffness"),
    [
        (JointImpedanceLaw, [14251.0] + [100.0] * 6),
        (JointImpedanceLaw, [float("nan")] * 7),
        (JointImpedanceLaw, [100.0] * 6),
        (CartesianImpedanceLaw, [3001.0] + [100.0] * 5),
        (CartesianImpedanceLaw, [100.0] * 5 + [301.0]),
        (CartesianImpedanceLaw, [100.0] * 5 + [float("nan")]),
        (CartesianImpedanceLaw, [100.0] * 7),
    ],
)
def test_a_stiffness_out_of_libfrankas_range_is_refused_and_the_one_before_stays(model, law_type, stiffness) -> None:
    law = law_type(model, LIMITS, [0.1] * 7, DT)
    before = law.stiffness[:]
    with pytest.raises(CommandError):
        law.set_stiffness(stiffness)
    assert law.stiffness == before


@pytest.mark.parametrize("law_type", [JointImpedanceLaw, CartesianImpedanceLaw])
def test_a_disturbed_arm_comes_back_to_its_desired_pose(model, law_type) -> None:
    law = law_type(model, LIMITS, [0.1] * 7, DT)
    q, dq = READY + 0.01, np.zeros(7)
    for _ in range(1500):
        tau = np.array(law.torque(state_at(q, READY, dq)))
        dq = dq + DT * np.linalg.solve(model.mass(q) + 0.1 * np.eye(7), tau - model.coriolis(q, dq))
        q = q + DT * dq
    assert np.abs(q - READY).max() < 1e-4


@pytest.mark.parametrize("law_type", [JointImpedanceLaw, CartesianImpedanceLaw])
@pytest.mark.parametrize("kind", [GeneratorMode.CARTESIAN_VELOCITY, GeneratorMode.JOINT_VELOCITY])
def test_the_arm_follows_a_generator_with_either_law(model, law_type, kind) -> None:
    law, generator, state = law_type(model, LIMITS, [0.1] * 7, DT), make_generator(kind, model, LIMITS), RobotState()
    state.q[:] = state.q_d[:] = READY.tolist()
    assert generator.start(state) == frozenset()
    q, dq, worst = READY, np.zeros(7), 0.0
    for step in range(1000):
        speed = 1.0 - np.cos(2.0 * np.pi * step * DT)
        command = MotionCommand([], [0.1 * speed] * 7, [], [0.0, 0.1 * speed, 0.0, 0.0, 0.0, 0.1 * speed], None, [])
        assert generator.advance(command) == frozenset()
        state.q[:], state.dq[:] = q.tolist(), dq.tolist()
        tau = np.array(law.torque(state))
        dq = dq + DT * np.linalg.solve(model.mass(q) + 0.1 * np.eye(7), tau - model.coriolis(q, dq))
        q = q + DT * dq
        worst = max(
            worst,
            np.abs(model.pose(FrankaFrame.END_EFFECTOR, q) - model.pose(FrankaFrame.END_EFFECTOR, state.q_d)).max(),
        )
    assert worst < 3e-3  # [m] and [rad]
    assert np.abs(q - READY).max() > 0.05


def test_a_stiffness_frame_set_later_counts_after_the_frames_are_updated(model) -> None:
    law, state = CartesianImpedanceLaw(model, LIMITS, [0.1] * 7, DT), state_at(READY, READY + 1e-4)
    before, T = law.torque(state), np.eye(4)
    T[2, 3] = 0.2
    model.set_stiffness_frame(T)
    assert law.torque(state) == pytest.approx(before)
    law.update_frames()
    assert law.torque(state) == pytest.approx(CartesianImpedanceLaw(model, LIMITS, [0.1] * 7, DT).torque(state))
    assert law.torque(state) != pytest.approx(before, abs=1e-3)
