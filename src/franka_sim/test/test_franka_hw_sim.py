import logging

import numpy as np
import pytest

from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import RobotMode
from franka_msgs.srv import SetEEFrameRequest, SetKFrameRequest, SetLoadRequest
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_control.hardware_interface import (
    EffortJointInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_core import plugins
from hric_core.errors import DescriptionError, HricError, ParameterError, UnknownNameError

YAW_45 = np.array([[0.0, -1, 0, 0.01], [1, 0, 0, 0.02], [0, 0, 1, 0.03], [0, 0, 0, 1]])


def test_it_is_found_by_its_plugin_name() -> None:
    assert plugins.find(plugins.ROBOT_HW, "franka_sim/FrankaHWSim") is FrankaHWSim


def test_it_offers_state_model_and_the_three_joint_interfaces(make_arm) -> None:
    hw = make_arm(arm_id="left", parameters={"arm_id": "left"}).hw
    names = tuple(f"left_joint{i}" for i in range(1, 8))
    for interface in (JointStateInterface, EffortJointInterface, VelocityJointInterface, PositionJointInterface):
        assert hw.get(interface).names == names
    assert hw.get(FrankaStateInterface).names == ("left_robot",)
    assert hw.get(FrankaModelInterface).names == ("left_model",)
    assert hw.compensates_gravity


def test_the_state_is_read_each_cycle_and_the_rest_computed_when_read(make_arm) -> None:
    arm = make_arm()
    hw, state = arm.hw, arm.hw.get(FrankaStateInterface).handle("panda_robot").robot_state
    arm.run(0.01)
    assert state.tick >= 10
    assert state.time == pytest.approx(0.009)
    assert state.q == hw.states.position
    assert state.robot_mode is RobotMode.IDLE
    expected = hw.model.pose(FrankaFrame.END_EFFECTOR, hw.states.position)
    np.testing.assert_allclose(np.array(state.O_T_EE).reshape(4, 4).T, expected, rtol=0.0, atol=1e-15)
    assert state.elbow == [hw.states.position[2], -1.0]
    assert np.abs(np.array(state.tau_J) - hw.model.gravity_list(hw.states.position)).max() < 1e-6
    assert state.snapshot().O_T_EE == state.O_T_EE


def test_the_model_handle_is_at_the_present_state(make_arm) -> None:
    arm = make_arm()
    handle = arm.hw.get(FrankaModelInterface).handle("panda_model")
    before = handle.pose(FrankaFrame.FLANGE)
    arm.hw.reset([0.3, -0.5, 0.1, -2.0, 0.2, 1.5, 0.5])
    arm.run(0.001)
    assert np.abs(handle.pose(FrankaFrame.FLANGE) - before).max() > 0.01
    assert np.allclose(
        handle.pose(FrankaFrame.FLANGE), arm.hw.model.pose(FrankaFrame.FLANGE, arm.hw.states.position), atol=1e-12
    )
    assert handle.mass() is handle.mass()


def test_the_model_equals_the_plant(make_arm) -> None:
    hw = make_arm(rpy="0.4 0.2 -0.6").hw
    assert np.abs(hw.model.mass(hw.states.position) - hw.plant.mass_matrix()).max() < 1e-9


def test_the_hand_stands_in_the_state_as_end_effector(make_arm) -> None:
    with_hand, bare = make_arm().hw.robot_state, make_arm(hand=False).hw.robot_state
    assert with_hand.m_ee == pytest.approx(0.76)
    assert with_hand.F_T_NE[14] == pytest.approx(0.1034)
    assert with_hand.F_T_EE == with_hand.F_T_NE
    assert bare.m_ee == 0.0
    assert bare.F_T_NE == [1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0]


def test_gravity_in_the_base_frame_follows_the_mounting(make_arm) -> None:
    state = make_arm(rpy="3.141592653589793 0 0").hw.robot_state
    assert np.allclose(state.O_ddP_O, [0, 0, 9.81])


# -- settings of the arm ----------------------------------------------------------------------------------------------


def test_a_load_that_is_set_changes_gravity_and_state_but_not_the_plant(make_arm) -> None:
    arm = make_arm()
    hw = arm.hw
    before, mass = hw.model.gravity_list(hw.q_start), hw.plant.mass_matrix()
    response = arm.node.call(
        "franka_control/set_load", SetLoadRequest(1.5, [0.0, 0.0, 0.1], [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.01])
    )
    assert (response.success, response.error) == (True, "")
    assert abs(hw.model.gravity_list(hw.q_start)[3] - before[3]) > 1.0
    state = hw.robot_state
    assert (state.m_load, state.F_x_Cload, state.I_load[0]) == (1.5, [0.0, 0.0, 0.1], 0.01)
    assert state.m_total == pytest.approx(state.m_ee + 1.5)
    assert np.array_equal(hw.plant.mass_matrix(), mass)


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        (SetLoadRequest(-1.0, [0.0] * 3, [0.0] * 9), "must not be negative"),
        (SetLoadRequest(float("nan"), [0.0] * 3, [0.0] * 9), "not finite"),
        (SetLoadRequest(1.0, [0.0] * 3, [0.0, 1, 0, 0, 0, 0, 0, 0, 0]), "not symmetric"),
    ],
)
def test_a_load_that_is_none_is_refused_with_the_reason(make_arm, request_, said) -> None:
    arm = make_arm()
    response = arm.node.call("franka_control/set_load", request_)
    assert not response.success
    assert said in response.error
    assert arm.hw.robot_state.m_load == 0.0


def test_frames_that_are_set_move_end_effector_and_stiffness_frame(make_arm) -> None:
    arm = make_arm()
    hw, state = arm.hw, arm.hw.robot_state
    values = YAW_45.T.ravel().tolist()
    assert arm.node.call("franka_control/set_EE_frame", SetEEFrameRequest(values)).success
    assert np.allclose(np.array(state.F_T_EE).reshape(4, 4).T, hw.model.F_T_NE @ YAW_45)
    assert np.allclose(state.NE_T_EE, values)
    assert arm.node.call("franka_control/set_K_frame", SetKFrameRequest(values)).success
    assert values == state.EE_T_K
    flange = hw.model.pose(FrankaFrame.FLANGE, hw.states.position)
    assert np.allclose(np.array(state.O_T_EE).reshape(4, 4).T, flange @ hw.model.F_T_NE @ YAW_45)
    assert np.allclose(
        hw.model.pose(FrankaFrame.STIFFNESS, hw.states.position), flange @ hw.model.F_T_NE @ YAW_45 @ YAW_45
    )


def test_a_frame_that_is_none_is_refused_with_the_reason(make_arm) -> None:
    arm = make_arm()
    for service, request in (
        ("set_EE_frame", SetEEFrameRequest([1.0] * 16)),
        ("set_K_frame", SetKFrameRequest([0.0] * 16)),
    ):
        response = arm.node.call(f"franka_control/{service}", request)
        assert not response.success
        assert "last row" in response.error


# -- parameters --------------------------------------------------------------------------------------------------------


def test_q_start_is_a_list_or_names_some_joints(make_arm) -> None:
    pose = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
    assert make_arm(parameters={"q_start": pose}).hw.states.position == pytest.approx(pose, abs=1e-12)
    some = make_arm(parameters={"q_start": {"panda_joint4": -1.5}}).hw
    assert some.states.position == pytest.approx([0, -np.pi / 4, 0, -1.5, 0, np.pi / 2, np.pi / 4], abs=1e-12)


def test_a_start_outside_the_range_is_allowed_and_said_once(make_arm, caplog) -> None:
    with caplog.at_level(logging.WARNING, "hric"):
        arm = make_arm(parameters={"q_start": [0.0] * 7})
        arm.run(0.01)
        arm.hw.reset()
    said = [record.getMessage() for record in caplog.records if "outside its range" in record.getMessage()]
    assert len(said) == 1
    assert "panda_joint4 starts at 0.0000 rad" in said[0]
    assert arm.hw.limiter_counts().started_outside == [False] * 3 + [True] + [False] * 3


@pytest.mark.parametrize(
    ("parameters", "error", "said"),
    [
        ({"arm_id": "right"}, ParameterError, r"/arm_id is 'right', but no link 'right_link0'.*panda_link0"),
        ({"arm_id": ""}, ParameterError, "/arm_id is ''; valid: a text that is not empty"),
        ({"q_start": [0.0] * 6}, ParameterError, "/q_start is .*; valid: 7 values, for panda_joint1"),
        ({"q_start": {"joint1": 0.0}}, UnknownNameError, r"no joint 'joint1' in /q_start; valid: panda_joint1"),
        ({"plant": 3}, ParameterError, "/plant is 3; valid: a mapping"),
        ({"plant": {"rotor": 1}}, HricError, "no parameter 'rotor' in plant"),
        ({"plant_type": "nowhere/Plant"}, UnknownNameError, "pybullet_ros_control/PyBulletPlant"),
        (
            {"enforce_limits": ["torque"]},
            ParameterError,
            r"/enforce_limits\[0\] is 'torque'; valid: position, velocity",
        ),
        ({"real_time_factor": -1.0}, HricError, "real_time_factor"),
        (
            {"internal_impedance": {"stiffness": [1.0]}},
            ParameterError,
            r"internal_impedance/stiffness is \[1.0\]; valid: a list of 7 finite numbers",
        ),
        (
            {"internal_impedance": {"damping": [1.0] * 7}},
            ParameterError,
            "no parameter 'damping' in /internal_impedance; valid: stiffness",
        ),
        (
            {"robot_description": "<robot name='table'><link name='plate'/></robot>"},
            ParameterError,
            "/arm_id is 'panda', but no link 'panda_link0' in robot table; valid: plate",
        ),
        ({"robot_description": "<robot/>"}, DescriptionError, "the robot description has no <link>"),
    ],
)
def test_a_wrong_parameter_is_refused_by_name_with_what_is_valid(make_arm, parameters, error, said) -> None:
    with pytest.raises(error, match=said):
        make_arm(parameters=parameters)


def test_identified_friction_gets_the_published_values(make_arm) -> None:
    arm = make_arm(plant={"friction": "identified"})
    assert arm.hw.plant.config.friction_parameters["panda_joint1"]["phi1"] == pytest.approx(0.54615)


def test_services_are_gone_after_shutdown(make_arm) -> None:
    arm = make_arm()
    assert "/franka_control/set_load" in arm.node.services()
    arm.close()
    assert not [name for name in arm.node.services() if "franka_control" in name]
