"""The compiled code of the arm computes the same numbers as KDL and pinocchio."""

import struct
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import PyKDL
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.box.estimates import ExternalTorque
from franka_sim.box.requests import GeneratorMode
from franka_sim.fci.protocol import PROTOCOL_5 as V5
from franka_sim.fci.protocol import PROTOCOL_10 as V10
from franka_sim.fci.protocol import Protocol
from franka_sim.fci.wire import MAX_FLOAT32

MASS, COM, INERTIA = 1.5, [0.02, -0.03, 0.1], [0.02, 0.001, 0.0, 0.001, 0.03, 0.0, 0.0, 0.0, 0.01]
PARAMETERS = panda_description.friction_parameters()
KINEMATICS = ("O_T_EE", "O_T_EE_d", "O_T_EE_c", "O_dP_EE_d", "elbow", "elbow_d", "elbow_c")
LEAST_SINGULAR_VALUE = 0.05


@pytest.fixture(params=["0 0 0", "0.4 -0.7 1.2"], ids=["floor", "tilted"])
def urdf(request: pytest.FixtureRequest) -> str:
    return panda_description.load(meshes=False, collision=False, rpy=request.param)


def states(n: int) -> np.ndarray:
    """Return random q, dq, ddq, shape (n, 3, 7)."""
    return np.random.default_rng(3).uniform(-1.0, 1.0, (n, 3, 7)) * np.array([[2.0], [2.0], [10.0]])


def same(got: Sequence[float], expected: Sequence[float], what: str = "") -> None:
    """Assert that two arrays agree within 1e-12 of the largest element."""
    scale = max(1.0, *map(abs, expected))
    assert got == pytest.approx(expected, rel=0.0, abs=1e-12 * scale), what


def make_box(urdf: str, friction: bool = False) -> ControlBox:
    """Return a control box with a payload and a stiffness frame that are not the defaults."""
    config = BoxConfig(friction=PARAMETERS if friction else None)
    box = ControlBox(KdlFrankaModel(urdf, "panda"), CompiledArm(urdf, "panda", LEAST_SINGULAR_VALUE), config)
    box.set_load(MASS, COM, INERTIA)
    box.set_EE_T_K([0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.1, 0.0, 0.2, 1.0])
    return box


class KdlExternalTorque:
    """External torque estimated as by `ExternalTorque`, but with KDL's inverse dynamics."""

    def __init__(self, model: KdlFrankaModel, config: BoxConfig) -> None:
        self.model, self.rate = model, 1.0 / config.time_step
        self.gain = 1.0 - np.exp(-2.0 * np.pi * config.external_torque_cutoff * config.time_step)
        self.value = np.zeros(7)

    def update(
        self, q: np.ndarray, dq: np.ndarray, dq_now: np.ndarray, tau: np.ndarray, friction: Sequence[float]
    ) -> None:
        chain = self.model.chain._solvers.chain
        solver = PyKDL.ChainIdSolver_RNE(chain, PyKDL.Vector(*self.model.gravity_base.tolist()))
        arrays = [PyKDL.JntArray(7) for _ in range(4)]
        for array, row in zip(arrays, (q, dq, self.rate * (dq_now - dq)), strict=False):
            for i, x in enumerate(row):
                array[i] = x
        solver.CartToJnt(*arrays[:3], [PyKDL.Wrench() for _ in range(chain.getNrOfSegments())], arrays[3])
        self.value += self.gain * (tau - list(arrays[3]) - friction - self.value)


def wrench_by_svd(box: ControlBox) -> tuple[list[float], list[float]]:
    """O_F_ext_hat_K and K_F_ext_hat_K: least squares in tau_ext = J_K(q)^T F by singular values of KDL's Jacobian."""
    U, s, Vt = np.linalg.svd(box.model.zero_jacobian(FrankaFrame.STIFFNESS, box.state.q), full_matrices=False)
    if s[-1] < LEAST_SINGULAR_VALUE:
        return [0.0] * 6, [0.0] * 6
    F = U @ ((Vt @ np.array(box.state.tau_ext_hat_filtered)) / s)
    R = box.model.pose(FrankaFrame.STIFFNESS, box.state.q)[:3, :3]
    return F.tolist(), [*(R.T @ F[:3]), *(R.T @ F[3:])]


def test_its_inverse_dynamics_is_pinocchios_with_hand_and_payload(urdf: str) -> None:
    model, arm = KdlFrankaModel(urdf, "panda"), CompiledArm(urdf, "panda", LEAST_SINGULAR_VALUE)
    model.set_load(MASS, COM, INERTIA)
    arm.take_model(model)
    other = pin.buildModelFromXML(urdf)
    flange = other.frames[other.getFrameId("panda_link8")].placement
    other.appendBodyToJoint(7, pin.Inertia(MASS, np.array(COM), np.array(INERTIA).reshape(3, 3)), flange)
    data = other.createData()
    for q, dq, ddq in states(200):
        assert arm.inverse_dynamics(q.tolist(), dq.tolist(), ddq.tolist()) == pytest.approx(
            pin.rnea(other, data, q, dq, ddq), abs=1e-9
        )


def test_its_gravity_is_that_of_kdl(urdf: str) -> None:
    model, arm = KdlFrankaModel(urdf, "panda"), CompiledArm(urdf, "panda", LEAST_SINGULAR_VALUE)
    for mass in (0.0, MASS):
        model.set_load(mass, COM, INERTIA if mass else [0.0] * 9)
        arm.take_model(model)
        for q, _, _ in states(200):
            same(arm.gravity(q.tolist()), model.gravity_list(q.tolist()))


@pytest.mark.parametrize("friction", [None, [0.3, -0.2, 0.1, 0.4, 0.5, -0.6, 0.7]], ids=["frictionless", "friction"])
def test_the_estimate_of_external_torque_is_that_of_kdl(urdf: str, friction: list[float] | None) -> None:
    model, config, arm = KdlFrankaModel(urdf, "panda"), BoxConfig(), CompiledArm(urdf, "panda", LEAST_SINGULAR_VALUE)
    arm.take_model(model)
    estimate, expected = ExternalTorque(arm, config), KdlExternalTorque(model, config)
    for k, (q, dq, tau) in enumerate(states(200)):
        if k == 100:
            model.set_load(MASS, COM, INERTIA)
            arm.take_model(model)
        q_now, dq_now = (q + 1e-3 * dq).tolist(), dq + 1e-3
        gravity = estimate.update(q.tolist(), dq.tolist(), q_now, dq_now.tolist(), tau.tolist(), friction)
        expected.update(q, dq, dq_now, tau, friction or [0.0] * 7)
        same(gravity, model.gravity_list(q_now))
        same(estimate.value, expected.value.tolist())
    assert max(map(abs, estimate.value)) > 1.0


def test_a_load_that_is_set_between_reading_and_writing_counts_at_once(urdf: str) -> None:
    before, between = make_box(urdf, friction=True), make_box(urdf, friction=True)
    for q, dq, tau in states(20):
        for box in (before, between):
            box.set_load(MASS, COM, INERTIA)
        before.set_load(0.5, COM, INERTIA)
        for box in (before, between):
            box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
        old = between.model.gravity_list(q.tolist())
        between.set_load(0.5, COM, INERTIA)
        same(between.write(None), before.write(None))
        assert np.abs(np.subtract(old, between.model.gravity_list(q.tolist()))).max() > 0.1


def test_a_snapshot_has_what_the_state_computes_field_by_field_and_the_wrench_of_least_squares(urdf: str) -> None:
    box, filled, zeros = make_box(urdf), 0, 0
    for q, dq, tau in states(200):
        box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
        box.state.dq_d[:] = dq.tolist()
        expected = {name: getattr(box.state, name) for name in (*KINEMATICS, "dtau_J")}
        expected["O_F_ext_hat_K"], expected["K_F_ext_hat_K"] = wrench_by_svd(box)
        snapshot = box.state.snapshot()
        for name, values in expected.items():
            assert getattr(snapshot, name) == pytest.approx(values, abs=1e-9), name
        torques, forces = box.state.lower()
        assert snapshot.joint_contact == [
            float(abs(x) > limit) for x, limit in zip(snapshot.tau_ext_hat_filtered, torques, strict=True)
        ]
        assert snapshot.cartesian_contact == [
            float(abs(x) > limit) for x, limit in zip(snapshot.K_F_ext_hat_K, forces, strict=True)
        ]
        filled += any(snapshot.O_F_ext_hat_K) and any(snapshot.joint_contact) and any(snapshot.cartesian_contact)
        zeros += snapshot.O_F_ext_hat_K == [0.0] * 6
    assert filled > 20 and 0 < zeros < 100, "poses near singularities and away from them"


@pytest.mark.parametrize("protocol", [V5, V10], ids=["panda", "fr3"])
def test_its_numbers_make_the_datagram_that_the_state_makes(urdf: str, protocol: Protocol) -> None:
    box = make_box(urdf)
    state, codec = box.state, protocol.state
    pack = state.fields.packer((*codec.names, *codec.accelerometers), codec.real)
    layout, random = struct.Struct(f"<284{codec.real}"), np.random.default_rng(1)
    for k, (q, dq, tau) in enumerate(states(40)):
        box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
        for name in ("q_d", "dq_d", "ddq_d", "tau_J_d", "joint_collision"):
            getattr(state, name)[:] = random.uniform(-1.0, 1.0, 7).tolist() if k % 3 else [0.0] * 7
        state.robot_mode, state.generator_mode = RobotMode.MOVE, GeneratorMode(k % 6)
        if state.generator_mode in (GeneratorMode.CARTESIAN_POSITION, GeneratorMode.CARTESIAN_VELOCITY):
            for name, size in (
                ("O_T_EE_d", 16),
                ("O_T_EE_c", 16),
                ("O_dP_EE_d", 6),
                ("O_ddP_EE_c", 6),
                ("elbow_c", 2),
                ("delbow_c", 2),
            ):
                setattr(state, name, random.uniform(-1.0, 1.0, size).tolist())
        else:
            state.O_ddP_EE_c, state.delbow_c = [0.0] * 6, [0.0] * 2
        if k == 20:
            box.set_collision_behavior(*[[3.0] * 7] * 4, *[[2.0] * 6] * 4)
        joined, plain = codec.join(k, pack(state), state), codec.encode(k, state)
        assert joined[:8] + joined[8 + layout.size :] == plain[:8] + plain[8 + layout.size :]
        expected = layout.unpack_from(plain, 8)
        assert layout.unpack_from(joined, 8) == pytest.approx(
            expected, rel=1e-12 if codec.real == "d" else 2e-7, abs=1e-9
        )


def test_numbers_too_large_for_32_bits_are_sent_as_the_largest(urdf: str) -> None:
    box = make_box(urdf)
    box.state.tau_J[:], box.state.dq[:] = [1e300] * 7, [-1e300] * 7
    names = ("tau_J", "dq", "m_load")
    numbers = struct.unpack("<15f", box.state.fields.packer(names, "f")(box.state))
    assert numbers == (*[MAX_FLOAT32] * 7, *[-MAX_FLOAT32] * 7, MASS)
