"""The compiled arm gives what KDL gives, number by number."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.compiled_arm import CompiledArm, compiled_arm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.box.estimates import ExternalTorque
from franka_sim.box.requests import GeneratorMode
from franka_sim.fci.commands_v5 import PROTOCOL as V5
from franka_sim.fci.commands_v10 import PROTOCOL as V10
from franka_sim.fci.protocol import Protocol
from franka_sim.fci.wire import MAX_FLOAT32
from hric_control.errors import HricError

MASS, COM, INERTIA = 1.5, [0.02, -0.03, 0.1], [0.02, 0.001, 0.0, 0.001, 0.03, 0.0, 0.0, 0.0, 0.01]
PARAMETERS = panda_description.friction_parameters()
KINEMATICS = ("O_T_EE", "O_T_EE_d", "O_T_EE_c", "O_dP_EE_d", "O_F_ext_hat_K", "K_F_ext_hat_K", "elbow", "elbow_d", "elbow_c", "joint_contact")


@pytest.fixture(params=["0 0 0", "0.4 -0.7 1.2"], ids=["floor", "tilted"])
def urdf(request: pytest.FixtureRequest) -> str:
    return panda_description.load(meshes=False, collision=False, rpy=request.param)


def states(n: int) -> np.ndarray:
    """Random q, dq, ddq, shape (n, 3, 7)."""
    return np.random.default_rng(3).uniform(-1.0, 1.0, (n, 3, 7)) * np.array([[2.0], [2.0], [10.0]])


def same(got: Sequence[float], expected: Sequence[float], what: str = "") -> None:
    """Within 1e-12 of the largest number."""
    scale = max(1.0, *map(abs, expected))
    assert got == pytest.approx(expected, rel=0.0, abs=1e-12 * scale), what


def boxes(urdf: str, friction: bool = False) -> tuple[ControlBox, ControlBox]:
    """(without, with compiled code) and a payload."""
    config = BoxConfig(friction=PARAMETERS if friction else None)
    pair = [ControlBox(KdlFrankaModel(urdf, "panda"), config, None, compiled) for compiled in (None, CompiledArm(urdf, "panda", 0.05))]
    for box in pair:
        box.set_load(MASS, COM, INERTIA)
        box.set_EE_T_K([0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.1, 0.0, 0.2, 1.0])
    return pair[0], pair[1]


def test_its_inverse_dynamics_is_pinocchios_with_hand_and_payload(urdf: str) -> None:
    model, arm = KdlFrankaModel(urdf, "panda"), CompiledArm(urdf, "panda", 0.05)
    model.set_load(MASS, COM, INERTIA)
    arm.take_model(model)
    other = pin.buildModelFromXML(urdf)
    flange = other.frames[other.getFrameId("panda_link8")].placement
    other.appendBodyToJoint(7, pin.Inertia(MASS, np.array(COM), np.array(INERTIA).reshape(3, 3)), flange)
    data = other.createData()
    for q, dq, ddq in states(200):
        assert arm.inverse_dynamics(q.tolist(), dq.tolist(), ddq.tolist()) == pytest.approx(pin.rnea(other, data, q, dq, ddq), abs=1e-9)


def test_its_gravity_is_that_of_kdl(urdf: str) -> None:
    model, arm = KdlFrankaModel(urdf, "panda"), CompiledArm(urdf, "panda", 0.05)
    for mass in (0.0, MASS):
        model.set_load(mass, COM, INERTIA if mass else [0.0] * 9)
        arm.take_model(model)
        for q, _, _ in states(200):
            same(arm.gravity(q.tolist()), model.gravity_list(q.tolist()))


@pytest.mark.parametrize("friction", [None, [0.3, -0.2, 0.1, 0.4, 0.5, -0.6, 0.7]], ids=["frictionless", "friction"])
def test_the_estimate_is_the_one_without_compiled_code(urdf: str, friction: list[float] | None) -> None:
    model, config = KdlFrankaModel(urdf, "panda"), BoxConfig()
    one, other = ExternalTorque(model, config), ExternalTorque(model, config, CompiledArm(urdf, "panda", 0.05))
    for k, (q, dq, tau) in enumerate(states(200)):
        if k == 100:
            model.set_load(MASS, COM, INERTIA)
            one.take_model()
            other.take_model()
        q_now = (q + 1e-3 * dq).tolist()
        gravity = [estimate.update(q.tolist(), dq.tolist(), q_now, (dq + 1e-3).tolist(), tau.tolist(), friction) for estimate in (one, other)]
        same(gravity[1], gravity[0])
        same(other.value, one.value)
    assert max(map(abs, one.value)) > 1.0


def test_the_torques_of_the_box_are_those_without_compiled_code(urdf: str) -> None:
    plain, fast = boxes(urdf, friction=True)
    for k, (q, dq, tau) in enumerate(states(50)):
        for box in (plain, fast):
            box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
            if k == 25:  # between reading and writing
                box.set_load(0.5, COM, INERTIA)
        same(fast.write(None), plain.write(None))
    for box in (plain, fast):
        box.reset([0.1] * 7)
    same(fast.write(None), plain.write(None))


def test_a_snapshot_is_the_one_without_compiled_code(urdf: str) -> None:
    pair, filled = boxes(urdf), 0
    for q, dq, tau in states(20):
        for box in pair:
            box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
            box.state.dq_d[:] = dq.tolist()
        plain, fast = (box.state.snapshot() for box in pair)
        for name in (*KINEMATICS, "cartesian_contact", "dtau_J"):
            assert getattr(fast, name) == pytest.approx(getattr(plain, name), abs=1e-9), name
        filled += any(plain.O_F_ext_hat_K) and any(plain.joint_contact) and any(plain.O_dP_EE_d)
    assert filled > 5


def test_a_wrench_read_by_itself_is_the_one_without_compiled_code_and_zero_near_a_singular_pose(urdf: str) -> None:
    pair, zeros = boxes(urdf), 0
    for q, dq, tau in states(200):
        for box in pair:
            box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
        plain, fast = (box.state.O_F_ext_hat_K for box in pair)
        assert fast == pytest.approx(plain, abs=1e-9)
        zeros += fast == [0.0] * 6
    assert 0 < zeros < 100


@pytest.mark.parametrize("protocol", [V5, V10], ids=["panda", "fr3"])
def test_its_numbers_make_the_datagram_that_the_state_makes(urdf: str, protocol: Protocol) -> None:
    _, box = boxes(urdf)
    state, codec = box.state, protocol.state
    assert state.compiled is not None
    pack = state.compiled.packer(codec.names, codec.real)
    layout, random = struct.Struct(f"<284{codec.real}"), np.random.default_rng(1)
    for k, (q, dq, tau) in enumerate(states(40)):
        box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
        for name in ("q_d", "dq_d", "ddq_d", "tau_J_d", "joint_collision"):
            getattr(state, name)[:] = random.uniform(-1.0, 1.0, 7).tolist() if k % 3 else [0.0] * 7
        state.robot_mode, state.generator_mode = RobotMode.MOVE, GeneratorMode(k % 6)
        if state.generator_mode in (GeneratorMode.CARTESIAN_POSITION, GeneratorMode.CARTESIAN_VELOCITY):
            for name, size in (("O_T_EE_d", 16), ("O_T_EE_c", 16), ("O_dP_EE_d", 6), ("O_ddP_EE_c", 6), ("elbow_c", 2), ("delbow_c", 2)):
                setattr(state, name, random.uniform(-1.0, 1.0, size).tolist())
        else:
            state.O_ddP_EE_c, state.delbow_c = [0.0] * 6, [0.0] * 2
        if k == 20:
            box.set_collision_behavior(*[[3.0] * 7] * 4, *[[2.0] * 6] * 4)
        joined, plain = codec.join(k, pack(state), state), codec.encode(k, state)
        assert joined[:8] + joined[8 + layout.size :] == plain[:8] + plain[8 + layout.size :]
        expected = layout.unpack_from(plain, 8)
        assert layout.unpack_from(joined, 8) == pytest.approx(expected, rel=1e-12 if codec.real == "d" else 2e-7, abs=1e-9)


def test_numbers_too_large_for_32_bits_are_sent_as_the_largest(urdf: str) -> None:
    _, box = boxes(urdf)
    assert box.state.compiled is not None
    box.state.tau_J[:], box.state.dq[:] = [1e300] * 7, [-1e300] * 7
    names = ("tau_J", "dq", "m_load")
    numbers = struct.unpack("<15f", box.state.compiled.packer(names, "f")(box.state))
    assert numbers == (*[MAX_FLOAT32] * 7, *[-MAX_FLOAT32] * 7, MASS)


def test_without_a_compiler_it_is_said_and_kdl_computes(monkeypatch: pytest.MonkeyPatch, urdf: str) -> None:
    def refuse(*_: object) -> bytes:
        raise HricError("no C compiler")

    monkeypatch.setattr("franka_sim.box.compiled_arm.compile_cached", refuse)
    said: list[str] = []
    assert compiled_arm(urdf, "panda", 0.05, said.append) is None
    assert len(said) == 1 and "no C compiler" in said[0]
