from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.compiled_arm import CompiledArm, compiled_arm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.box.estimates import ExternalTorque
from hric_control.errors import HricError

MASS, COM, INERTIA = 1.5, [0.02, -0.03, 0.1], [0.02, 0.001, 0.0, 0.001, 0.03, 0.0, 0.0, 0.0, 0.01]


@pytest.fixture(params=["0 0 0", "0.4 -0.7 1.2"], ids=["floor", "tilted"])
def urdf(request: pytest.FixtureRequest) -> str:
    return panda_description.load(meshes=False, collision=False, rpy=request.param)


def states(n: int) -> np.ndarray:
    """Random q, dq, ddq, shape (n, 3, 7)."""
    return np.random.default_rng(3).uniform(-1.0, 1.0, (n, 3, 7)) * np.array([[2.0], [2.0], [10.0]])


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


def test_the_estimate_is_the_one_without_compiled_code(urdf: str) -> None:
    model, config = KdlFrankaModel(urdf, "panda"), BoxConfig()
    one, other = ExternalTorque(model, config), ExternalTorque(model, config, CompiledArm(urdf, "panda", 0.05))
    for k, (q, dq, tau) in enumerate(states(50)):
        if k == 25:
            model.set_load(MASS, COM, INERTIA)
            one.take_model()
            other.take_model()
        for estimate in (one, other):
            estimate.update(q.tolist(), dq.tolist(), (dq + 1e-3).tolist(), tau.tolist(), None)
    assert other.value == pytest.approx(one.value, abs=1e-9)
    assert max(map(abs, one.value)) > 1.0


def test_a_snapshot_is_the_one_without_compiled_code(urdf: str) -> None:
    boxes = [ControlBox(KdlFrankaModel(urdf, "panda"), None, None, compiled) for compiled in (None, CompiledArm(urdf, "panda", 0.05))]
    for q, dq, tau in states(20):
        for box in boxes:
            box.read(q.tolist(), dq.tolist(), tau.tolist(), 0.0)
        plain, fast = (box.state.snapshot() for box in boxes)
        for name in ("O_T_EE", "O_T_EE_d", "O_dP_EE_d", "O_F_ext_hat_K", "K_F_ext_hat_K", "elbow", "elbow_d", "joint_contact"):
            assert getattr(fast, name) == pytest.approx(getattr(plain, name), abs=1e-9), name


def test_without_a_compiler_it_is_said_and_kdl_computes(monkeypatch: pytest.MonkeyPatch, urdf: str) -> None:
    def refuse(*_: object) -> bytes:
        raise HricError("no C compiler")

    monkeypatch.setattr("franka_sim.box.compiled_arm.compile_cached", refuse)
    said: list[str] = []
    assert compiled_arm(urdf, "panda", 0.05, said.append) is None
    assert len(said) == 1 and "no C compiler" in said[0]
