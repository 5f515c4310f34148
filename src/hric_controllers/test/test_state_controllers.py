import pytest
from controllers_rig import DT, Lab, Rig

from franka_hw_interface.interfaces import FrankaStateInterface
from franka_hw_interface.robot_state import FIELD_NAMES, RobotMode, RobotState, errors
from franka_msgs.msg import Errors, FrankaState
from hric_controllers.state.messages import franka_state
from hric_core import plugins
from hric_core.errors import HricError

ARM = [f"panda_joint{i}" for i in range(1, 8)]
JS = {"type": "joint_state_controller/JointStateController", "publish_rate": 50}
FS = {"type": "franka_control/FrankaStateController", "arm_id": "panda", "joint_names": ARM}


def joint_state_lab(**extra):
    return Lab({"robot": {"js": {**JS, **extra}}, "js": {**JS, **extra}}).load("js")


def franka_lab(**extra):
    hw = Rig(ARM)
    hw.arm = RobotState()
    hw.register_interface(FrankaStateInterface("panda", hw.arm))
    return Lab({"fs": {**FS, **extra}}, hw=hw).load("fs")


def test_joint_states_carry_all_joints_with_position_velocity_and_effort():
    bench = joint_state_lab()
    bench.hw.states.position[:], bench.hw.states.velocity[:] = [0.1, 0.2], [0.3, 0.4]
    bench.hw.states.effort[:] = [5.0, 6.0]
    message = bench.run(DT).published("/joint_states")[0]
    assert message.name == ["a", "b"]
    assert (list(message.position), list(message.velocity), list(message.effort)) == (
        [0.1, 0.2],
        [0.3, 0.4],
        [5.0, 6.0],
    )


def test_joint_states_come_at_the_publish_rate_stamped_with_robot_time():
    messages = joint_state_lab().run(1.0).published("/joint_states")
    assert len(messages) == 50
    assert messages[10].header.stamp.to_sec() == pytest.approx(0.2)


def test_a_rate_that_does_not_divide_the_loop_rate_is_kept_on_average():
    assert len(joint_state_lab(publish_rate=30).run(2.0).published("/joint_states")) == 60


def test_a_message_once_sent_does_not_change_with_the_robot():
    bench = joint_state_lab()
    message = bench.run(DT).published("/joint_states")[0]
    bench.hw.states.position[0] = 9.0
    assert message.position[0] == 0.0


def test_the_publish_rate_must_be_given():
    with pytest.raises(HricError, match="/js/publish_rate"):
        Lab({"js": {"type": JS["type"]}}).load("js")


def test_extra_joints_are_added_with_their_constant_values():
    bench = joint_state_lab(extra_joints=[{"name": "wheel", "position": 1.5}])
    message = bench.run(DT).published("/joint_states")[0]
    assert message.name == ["a", "b", "wheel"]
    assert (message.position[2], message.velocity[2], message.effort[2]) == (1.5, 0.0, 0.0)


@pytest.mark.parametrize("extra", [[{"position": 1.0}], [{"name": "a"}], [{"name": "w", "position": "up"}], "wheel"])
def test_extra_joints_that_make_no_sense_are_refused(extra):
    with pytest.raises(HricError, match="extra_joints"):
        joint_state_lab(extra_joints=extra)


def test_a_joint_state_controller_claims_nothing():
    assert joint_state_lab().manager.list()[0].claims == {}


def test_every_field_of_the_arms_state_is_in_the_message():
    state = RobotState()
    for number, name in enumerate(FIELD_NAMES):
        value = getattr(state, name)
        if isinstance(value, list):
            setattr(state, name, [float(number + k) for k in range(len(value))])
        elif isinstance(value, float):
            setattr(state, name, float(number))
    state.robot_mode, state.current_errors = RobotMode.REFLEX, errors(["joint_reflex"])
    message = franka_state(state, None)
    special = {"robot_mode", "current_errors", "last_motion_errors"}
    assert set(FrankaState.__slots__) - {"header"} == set(FIELD_NAMES)
    for name in set(FIELD_NAMES) - special:
        assert getattr(message, name) == getattr(state, name)
    assert message.robot_mode == FrankaState.ROBOT_MODE_REFLEX
    assert message.current_errors == Errors(joint_reflex=True)
    assert message.last_motion_errors == Errors()


def test_the_arms_state_comes_at_30_hz_by_default_on_the_topics_of_franka_ros():
    bench = franka_lab().run(1.0)
    for topic in ("/fs/franka_states", "/fs/joint_states", "/fs/joint_states_desired", "/fs/F_ext", "/tf"):
        assert len(bench.published(topic)) == 30, topic


def test_measured_and_desired_joint_states_come_from_their_fields():
    bench = franka_lab()
    bench.hw.arm.q[0], bench.hw.arm.tau_J[1], bench.hw.arm.q_d[2], bench.hw.arm.tau_J_d[3] = 1.0, 2.0, 3.0, 4.0
    bench.run(DT)
    measured, desired = bench.published("/fs/joint_states")[0], bench.published("/fs/joint_states_desired")[0]
    assert (measured.name, measured.position[0], measured.effort[1]) == (ARM, 1.0, 2.0)
    assert (desired.position[2], desired.effort[3]) == (3.0, 4.0)


def test_the_external_wrench_is_expressed_in_the_stiffness_frame():
    bench = franka_lab()
    bench.hw.arm.K_F_ext_hat_K[:] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    message = bench.run(DT).published("/fs/F_ext")[0]
    assert message.header.frame_id == "panda_K"
    assert (message.wrench.force.z, message.wrench.torque.x) == (3.0, 4.0)


def test_the_end_effector_frames_form_a_chain_from_the_flange():
    bench = franka_lab()
    bench.hw.arm.NE_T_EE[12:15] = [0.0, 0.0, 0.1034]
    frames = bench.run(DT).published("/tf")[0].transforms
    chain = [(frame.header.frame_id, frame.child_frame_id) for frame in frames]
    assert chain == [("panda_link8", "panda_NE"), ("panda_NE", "panda_EE"), ("panda_EE", "panda_K")]
    assert frames[1].transform.translation.z == pytest.approx(0.1034)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ({"arm_id": "lynx"}, "lynx_robot"),
        ({"joint_names": ARM[:6]}, "joint_names is .*; valid: a list of 7 names"),
        ({"publish_rate": 0}, "/fs/publish_rate is 0"),
    ],
)
def test_a_bad_parameter_of_the_franka_state_controller_is_refused_by_name(extra, words):
    with pytest.raises(HricError, match=words):
        franka_lab(**extra)


def test_a_robot_without_the_franka_state_is_refused_by_name():
    with pytest.raises(HricError, match="FrankaStateInterface"):
        Lab({"fs": FS}).load("fs")


@pytest.mark.parametrize(
    ("alias", "name"),
    [
        ("joint_state_controller/JointStateController", "hric_controllers/JointStateController"),
        ("franka_control/FrankaStateController", "hric_controllers/FrankaStateController"),
        ("effort_controllers/JointTrajectoryController", "hric_controllers/EffortJointTrajectoryController"),
        ("position_controllers/JointTrajectoryController", "hric_controllers/PositionJointTrajectoryController"),
    ],
)
def test_the_type_names_of_existing_yaml_find_our_controllers(alias, name):
    assert plugins.find(plugins.CONTROLLER, alias) is plugins.find(plugins.CONTROLLER, name)
