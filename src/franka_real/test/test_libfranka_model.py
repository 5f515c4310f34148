"""What a LibfrankaModel takes over from the connected arm. What it computes is tested with every FrankaModel:
franka_hw_interface, test_model.py."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from libfranka_box import arm

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame, FrankaModel, FrankaModelHandle
from franka_hw_interface.robot_state import RobotState
from franka_real.libfranka_model import LibfrankaModel
from hric_core.errors import CommandError, DescriptionError, UnknownNameError

Q = [0.1, -0.6, 0.2, -2.1, -0.3, 1.7, 0.5]
COM, INERTIA = [0.01, 0.02, 0.1], [0.01, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.015]
UNIT = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""First three columns of a pose that is not turned."""
TOLERANCE = {"panda": 1e-12, "fr3": 1e-5}
"""Difference from KDL: the FR3 tells masses, frames and gravity in single precision."""


def description(arm_id: str) -> str:
    inertials = "fr3" if arm_id == "fr3" else "barycentric"
    return panda_description.load(arm_id=arm_id, inertials=inertials, meshes=False, collision=False)


def build(kind: str, robot: Any, state: Any = None) -> LibfrankaModel:
    state, model = state or robot.read_once(), robot.load_model()
    return (
        LibfrankaModel.for_panda(model, state)
        if kind == "panda"
        else LibfrankaModel.for_fr3(model, state, description("fr3"), "fr3")
    )


@pytest.fixture(scope="module", params=["panda", "fr3"])
def connected(request: pytest.FixtureRequest) -> Iterator[tuple[str, Any]]:
    with arm(request.param) as robot:
        yield request.param, robot


@pytest.fixture
def kdl(connected: tuple[str, Any]) -> KdlFrankaModel:
    return KdlFrankaModel(description(connected[0]), connected[0])


def wait_for(robot: Any, condition: Callable[[Any], bool]) -> Any:
    """Return the first state that fulfils a condition; libfranka may still have older states buffered."""
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        state = robot.read_once()
        if condition(state):
            return state
    raise AssertionError("the arm never reported so")


def apart(one: FrankaModel, other: FrankaModel) -> float:
    pairs = [
        (one.mass(Q), other.mass(Q)),
        (one.gravity(Q), other.gravity(Q)),
        (one.coriolis(Q, Q), other.coriolis(Q, Q)),
    ]
    pairs += [(one.pose(frame, Q), other.pose(frame, Q)) for frame in FrankaFrame] + [
        (one.zero_jacobian(f, Q), other.zero_jacobian(f, Q)) for f in FrankaFrame
    ]
    return max(float(np.abs(a - b).max()) for a, b in pairs)


def test_it_is_a_franka_model_with_the_hand_that_the_arm_reports(connected, kdl) -> None:
    kind, robot = connected
    model = build(kind, robot)
    assert isinstance(model, FrankaModel) and apart(model, kdl) < TOLERANCE[kind]
    assert model.ee_inertial.mass == pytest.approx(kdl.ee_inertial.mass, abs=1e-6) and model.load.mass == 0.0
    assert np.allclose(model.F_T_EE, kdl.F_T_EE, rtol=0, atol=1e-6)


def tell(kind: str, robot: Any, mass: float, NE_T_EE: list[float], EE_T_K: list[float]) -> None:
    """Set a payload and frames of the arm, 16 column-major floats each."""
    robot.set_load(mass, COM, INERTIA)
    set_ee, set_k = (robot.set_ee, robot.set_k) if kind == "panda" else (robot.set_EE, robot.set_K)
    set_ee(NE_T_EE)
    set_k(EE_T_K)


def test_payload_and_frames_set_in_the_arm_reach_the_model_by_following_its_state(connected, kdl) -> None:
    kind, robot = connected
    model = build(kind, robot)
    tell(kind, robot, 1.5, [*UNIT, 0.01, 0.02, 0.03, 1.0], [*UNIT, 0.0, -0.05, 0.1, 1.0])
    state = wait_for(robot, lambda state: state.m_load > 1.0 and state.EE_T_K[14] > 0.05)
    kdl.set_load(1.5, COM, INERTIA)
    kdl.set_ee(kdl.F_T_NE @ np.array([*UNIT, 0.01, 0.02, 0.03, 1.0]).reshape(4, 4).T)
    kdl.set_stiffness_frame(np.array([*UNIT, 0.0, -0.05, 0.1, 1.0]).reshape(4, 4).T)
    revision, before = model.revision, apart(model, kdl)
    assert model.follow(state) and model.revision > revision
    assert apart(model, kdl) < TOLERANCE[kind] and before > 1.0
    tell(kind, robot, 0.0, [*UNIT, 0.0, 0.0, 0.0, 1.0], [*UNIT, 0.0, 0.0, 0.0, 1.0])
    wait_for(robot, lambda state: state.m_load == 0.0 and state.EE_T_K[14] == 0.0)


def test_a_state_that_reports_the_same_changes_nothing_and_leaves_what_was_set_since(connected) -> None:
    kind, robot = connected
    model = build(kind, robot)
    model.set_load(2.0, [0, 0, 0.1], [0.0] * 9)
    revision = model.revision
    assert not model.follow(robot.read_once()) and model.revision == revision and model.load.mass == 2.0


def test_a_state_that_reports_nonsense_is_refused_and_the_model_stays(connected) -> None:
    kind, robot = connected
    model = build(kind, robot)
    before = model.gravity(Q)
    with pytest.raises(CommandError, match="the arm reports an impossible m_load nan"):
        model.follow(RobotState(m_load=float("nan")))
    with pytest.raises(CommandError, match="F_T_EE"):
        model.follow(RobotState(m_load=3.0, F_T_EE=[0.0] * 16))
    assert np.array_equal(model.gravity(Q), before)


def test_the_handle_computes_once_per_tick_through_it(connected, kdl) -> None:
    kind, robot = connected
    state = RobotState(q=list(Q), dq=list(Q))
    handle = FrankaModelHandle("model", build(kind, robot), state)
    assert handle.mass() is handle.mass() and np.abs(handle.gravity() - kdl.gravity(Q)).max() < TOLERANCE[kind]


def test_arguments_that_are_none_are_refused_by_name(connected) -> None:
    model = build(*connected)
    with pytest.raises(CommandError, match="joint velocity has 3 values for 7 joints"):
        model.coriolis(Q, [0.0] * 3)
    with pytest.raises(CommandError, match="gravity must be three finite numbers"):
        model.gravity(Q, [0.0, float("nan"), 0.0])
    with pytest.raises(UnknownNameError, match=r"no frame 'joint1' in LibfrankaModel; valid: Frame\.END_EFFECTOR"):
        model.pose("joint1", Q)  # type: ignore[arg-type]


@pytest.mark.parametrize("connected", ["fr3"], indirect=True)
def test_a_description_of_another_arm_is_refused(connected) -> None:
    robot = connected[1]
    shorter = description("fr3").replace("0.316", "0.31")
    assert shorter != description("fr3")
    with pytest.raises(DescriptionError, match=r"fr3_link8 differs from libfranka's by 0\.00"):
        LibfrankaModel.for_fr3(robot.load_model(), robot.read_once(), shorter, "fr3")
