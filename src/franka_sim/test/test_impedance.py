from collections.abc import Sequence

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_sim.box.internal_impedance import JointImpedance, JointImpedanceLaw, defaults
from hric_core.geometry import FloatArray

POSES = 1000


def spectral_radius(mass: FloatArray, stiffness: Sequence[float], damping: Sequence[float], time_step: float) -> float:
    """Largest eigenvalue of the sampled loop around a pose, by magnitude: below 1 it is stable.

    The arm is (M+B) ddq = tau, the torque held over each time step: v' = v + dt a, q' = q + dt v + dt^2/2 a.

    mass: M+B, shape (n, n) [kg m^2].
    """
    n, dt = len(mass), time_step
    by_q, by_v = np.linalg.solve(mass, np.diag(stiffness)), np.linalg.solve(mass, np.diag(damping))
    one = np.eye(n)
    step = np.block([[one - dt * dt / 2 * by_q, dt * one - dt * dt / 2 * by_v], [-dt * by_q, one - dt * by_v]])
    return float(np.abs(np.linalg.eigvals(step)).max())


ROTORS = panda_description.rotor_inertia()


@pytest.mark.parametrize(
    ("rotor_inertia", "bound"), [(ROTORS, 0.995), ([0.1] * 7, 0.995), ([0.03] * 7, 0.998), ([0.0] * 7, 0.9995)]
)
def test_the_internal_impedance_is_stable_at_1_khz_over_1000_legal_poses_with_and_without_payload(
    rotor_inertia, bound
) -> None:
    urdf = panda_description.load(meshes=False, collision=False)
    model = KdlFrankaModel(urdf, "panda")
    gains = JointImpedanceLaw(model, franka_limits(), rotor_inertia, 0.001)
    limits, rng = list(panda_description.joint_limits().values()), np.random.default_rng(11)
    poses = rng.uniform([joint.lower for joint in limits], [joint.upper for joint in limits], (POSES, 7))
    worst = 0.0
    for load in (0.0, 3.0):
        model.set_load(load, [0.0, 0.0, 0.1], np.eye(3) * 0.01)
        B = np.diag(rotor_inertia)
        worst = max(worst, *(spectral_radius(model.mass(q) + B, gains.stiffness, gains.damping, 0.001) for q in poses))
    assert worst < bound


def test_the_default_stiffness_needs_no_lowering_with_rotor_inertia() -> None:
    urdf = panda_description.load(meshes=False, collision=False)
    gains = JointImpedanceLaw(KdlFrankaModel(urdf, "panda"), franka_limits(), ROTORS, 0.001)
    assert list(gains.stiffness) == defaults()["stiffness"] == [3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0]
    assert min(d / w for d, w in zip(gains.damping, defaults()["damping"], strict=True)) > 0.85


def test_the_unlowered_gains_would_be_unstable_without_rotor_inertia() -> None:
    model = KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda")
    M = model.mass([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    assert spectral_radius(M, defaults()["stiffness"], defaults()["damping"], 0.001) > 1.0


def test_the_torque_is_a_spring_and_a_damper_within_the_limit() -> None:
    law = JointImpedance((100.0, 100.0), (10.0, 10.0), (5.0, 50.0))
    assert law.torque([0.1, 0.1], [0.0, 1.0], [0.0, 0.0], [0.0, 0.0]) == [5.0, 20.0]
    assert law.torque([-1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.2]) == [-5.0, -2.0]
