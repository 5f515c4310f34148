"""The services in the namespace `sim`, on a robot with very simple physics."""

import importlib
import math
import sys
import threading
import time
from pathlib import Path

import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3, Wrench
from sensor_msgs.msg import JointState
from std_srvs.srv import EmptyRequest

from gazebo_msgs.msg import ContactsState, ModelStates
from gazebo_msgs.srv import (
    ApplyBodyWrenchRequest,
    BodyRequestRequest,
    DeleteModelRequest,
    GetLinkStateRequest,
    SetModelConfigurationRequest,
    SpawnModelRequest,
)
from hric_control.plant import Contact
from hric_control.sim import contact_info, services
from hric_core.local.node import LocalNode
from hric_core.robot_time import stamps
from hric_core.scoped_node import ScopedNode
from hric_msgs.msg import JointReactions
from hric_msgs.srv import SetRealTimeFactorRequest, StepSimulationRequest

sys.path.append(str(Path(__file__).parent))
toy = importlib.import_module("double_integrator_robot")


@pytest.fixture
def node():
    return LocalNode()


@pytest.fixture
def robot(node):
    hw = toy.ToyRobot()
    hw.init(node, LocalNode({"real_time_factor": 0.0}))
    node.clock = lambda: hw.loop.time
    offered = ScopedNode(node)
    services.SimServices(hw, offered)
    yield hw
    offered.close()
    assert not [name for name in node.services() if name.startswith("/sim")]


def cycles(hw, n):
    """Run n cycles; return the argument `reset_controllers` of each."""
    resets = []

    def on_cycle(time, period, reset):
        resets.append(reset)
        if len(resets) == n:
            hw.stop()
        return True

    hw.run(on_cycle)
    return resets


def test_the_pace_of_a_paced_run_is_changed(node, robot):
    robot.loop.real_time_factor = 1.0
    answer = node.call("sim/set_real_time_factor", SetRealTimeFactorRequest(0.25))
    assert (answer.success, answer.status_message) == (True, "0.25 s of robot time per second")
    assert robot.loop.real_time_factor == robot.loop.pace.factor == 0.25


@pytest.mark.parametrize("factor", [0.0, -1.0, 1000.0, math.nan, math.inf])
def test_an_impossible_pace_is_refused_with_the_range(node, robot, factor):
    robot.loop.real_time_factor = 1.0
    answer = node.call("sim/set_real_time_factor", SetRealTimeFactorRequest(factor))
    assert not answer.success and "0.01 to 100" in answer.status_message
    assert robot.loop.real_time_factor == 1.0


def test_a_run_that_is_not_paced_stays_so(node, robot):
    answer = node.call("sim/set_real_time_factor", SetRealTimeFactorRequest(0.5))
    assert not answer.success and "this run is not paced" in answer.status_message
    assert robot.loop.real_time_factor == 0.0


def configure(node, names, positions, model=""):
    return node.call("sim/set_model_configuration", SetModelConfigurationRequest(model, "", names, positions))


def test_reset_puts_robot_and_world_back_and_lets_time_go_on(node, robot):
    cycles(robot, 10)
    robot.plant.q[:] = [0.5, 0.5]
    node.call("sim/reset_world", EmptyRequest())
    assert robot.plant.q.tolist() == [0.0, 0.0]
    node.call("sim/reset_simulation", EmptyRequest())
    assert robot.plant.resets == 2
    assert robot.loop.time == 0.01


def test_a_configuration_is_set_for_the_named_joints_and_controllers_restart(node, robot):
    robot.plant.q[:] = [0.1, 0.2]
    cycles(robot, 1)
    answer = configure(node, ["j2"], [0.7], "toy")
    assert (answer.success, answer.status_message) == (True, "1 joints set")
    assert robot.plant.q.tolist() == [0.1, 0.7]
    assert cycles(robot, 2) == [True, False]


@pytest.mark.parametrize(
    ("names", "positions", "says"),
    [
        (["j1", "elbow"], [0.0, 0.0], "no joint 'elbow' in toy; valid: j1, j2"),
        (["j1"], [0.0, 1.0], "1 joint_names (all different, at least one) need as many joint_positions; got 2"),
        (["j1", "j1"], [0.0, 1.0], "2 joint_names (all different"),
        ([], [], "0 joint_names"),
        (["j1"], [math.nan], "joint_positions is not finite: nan"),
    ],
)
def test_a_wrong_configuration_is_refused_and_nothing_moves(node, robot, names, positions, says):
    answer = configure(node, names, positions)
    assert not answer.success
    assert says in answer.status_message
    assert robot.plant.q.tolist() == [0.0, 0.0]


def test_a_configuration_of_another_model_is_refused(node, robot):
    assert configure(node, ["j1"], [0.0], "cube").status_message == "no model with joints 'cube'; valid: toy"


def test_a_configuration_outside_the_range_is_set_with_a_warning(node, robot):
    answer = configure(node, ["j2"], [1.5])
    assert answer.success
    assert "warning: j2 at 1.5 rad is outside its range [-1, 1]" in answer.status_message
    assert robot.plant.q.tolist() == [0.0, 1.5]


def wrench(node, body="one", frame="", force=(1.0, 2.0, 3.0), start=0.0, duration=0.5):
    request = ApplyBodyWrenchRequest(body_name=body, reference_frame=frame, reference_point=Point(0.1, 0.0, 0.0))
    request.wrench = Wrench(force=Vector3(*force), torque=Vector3(0.0, 1.0, 0.0))
    request.start_time, request.duration = stamps.to_time(start), stamps.to_duration(duration)
    return node.call("sim/apply_body_wrench", request)


def test_a_wrench_in_the_world_frame_is_passed_on(node, robot):
    assert wrench(node).success
    assert robot.plant.wrenches == [("one", (1.0, 2.0, 3.0), (0.0, 1.0, 0.0), (0.1, 0.0, 0.0), 0.5, 0)]


def test_a_wrench_in_a_link_frame_is_turned_into_the_world_frame(node, robot):
    robot.plant.q[0] = math.pi / 2
    assert wrench(node, frame="one", force=(1.0, 0.0, 3.0)).success
    _, force, torque, point, _, _ = robot.plant.wrenches[0]
    assert force == pytest.approx((0.0, 1.0, 3.0))
    assert torque == pytest.approx((-1.0, 0.0, 0.0))
    assert point == (0.1, 0.0, 0.0)


def test_a_wrench_may_begin_later_and_last_until_cleared(node, robot):
    cycles(robot, 5)
    assert wrench(node, start=0.010, duration=-1.0).status_message == "wrench on one from 0.01 s until cleared"
    assert wrench(node, body="two", start=0.002).success  # its time is past: it begins now
    cycles(robot, 20)
    assert [(entry[0], entry[4], entry[5]) for entry in robot.plant.wrenches] == [("two", 0.5, 5), ("one", -1.0, 10)]
    node.call("sim/clear_body_wrenches", BodyRequestRequest("one"))
    assert [entry[0] for entry in robot.plant.wrenches] == ["two"]


def test_clearing_also_forgets_wrenches_that_have_not_begun(node, robot):
    wrench(node, start=0.010)
    node.call("sim/clear_body_wrenches", BodyRequestRequest("one"))
    cycles(robot, 20)
    assert robot.plant.wrenches == []


def test_a_wrench_on_an_unknown_body_or_in_an_unknown_frame_is_refused(node, robot):
    assert wrench(node, body="nose").status_message == "no link 'nose'; valid: base, one, two"
    assert "no link 'head'" in wrench(node, frame="head").status_message
    assert "force is not finite" in wrench(node, force=(math.inf, 0.0, 0.0)).status_message
    assert robot.plant.wrenches == []


def spawn(node, name="cube", xml=toy.CUBE, pose=None, frame=""):
    return node.call("sim/spawn_urdf_model", SpawnModelRequest(name, xml, "", pose or Pose(), frame))


def test_a_model_is_spawned_at_its_pose_and_deleted(node, robot):
    pose = Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    assert spawn(node, pose=pose).status_message == "cube spawned"
    T, fixed = robot.plant.models["cube"]
    assert T[:3, 3].tolist() == [1.0, 2.0, 3.0]
    assert T[:3, 0].tolist() == pytest.approx([0.0, 1.0, 0.0])
    assert not fixed
    assert not spawn(node).success
    assert node.call("sim/delete_model", DeleteModelRequest("cube")).success
    assert node.call("sim/delete_model", DeleteModelRequest("cube")).status_message == "no model 'cube'; valid: none"


def test_a_model_whose_root_is_the_world_is_fixed_and_a_frame_places_it(node, robot):
    spawn(node, xml=toy.CUBE.replace("cube_link", "world"), frame="one")
    T, fixed = robot.plant.models["cube"]
    assert fixed
    assert T[:3, 3].tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"name": ""}, "model_name must be a name"),
        ({"name": "toy"}, "is the robot's own"),
        ({"xml": "<cube/>"}, "must be <robot>"),
        ({"xml": "nonsense"}, "is not XML"),
        ({"xml": "<robot name='x'/>"}, "has no <link>; a robot needs at least one"),
        ({"pose": Pose(Point(), Quaternion(0.0, 0.0, 0.5, 0.5))}, "is not a unit quaternion"),
        ({"pose": Pose(Point(math.nan, 0.0, 0.0), Quaternion())}, "position is not finite"),
    ],
)
def test_a_model_that_cannot_be_spawned_is_refused_with_the_reason(node, robot, arguments, says):
    answer = spawn(node, **arguments)
    assert not answer.success
    assert says in answer.status_message
    assert robot.plant.models == {}


def link_state(node, link, frame=""):
    return node.call("sim/get_link_state", GetLinkStateRequest(link, frame))


def test_the_state_of_a_link_is_told_in_the_world_or_in_another_links_frame(node, robot):
    robot.plant.q[0] = math.pi / 2
    answer = link_state(node, "two").link_state
    assert answer.reference_frame == "world"
    assert (answer.pose.position.x, answer.pose.position.y) == pytest.approx((0.0, 1.0))
    assert (answer.pose.orientation.z, answer.pose.orientation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
    answer = link_state(node, "base", "one").link_state
    assert (answer.pose.position.x, answer.pose.position.y) == pytest.approx((-1.0, 0.0))
    assert (answer.twist.linear.x, answer.twist.linear.y) == pytest.approx((0.0, -1.0))
    assert link_state(node, "nose").status_message == "no link 'nose'; valid: base, one, two"


def test_pause_step_and_unpause_from_other_threads(node, robot):
    node.call("sim/pause_physics", EmptyRequest())
    thread = threading.Thread(target=lambda: robot.run(lambda *_: True))
    thread.start()
    while not robot.loop.running:
        time.sleep(0.001)
    answer = node.call("sim/step", StepSimulationRequest(25))
    assert (answer.success, answer.time, answer.status_message) == (True, 0.025, "25 cycles done")
    assert robot.plant.steps == 25
    assert not node.call("sim/step", StepSimulationRequest(0)).success
    assert configure(node, ["j1"], [0.3]).success
    assert robot.loop.time == 0.025
    node.call("sim/unpause_physics", EmptyRequest())
    while robot.loop.time < 0.05:
        time.sleep(0.001)
    assert "not paused" in node.call("sim/step", StepSimulationRequest(1)).status_message
    robot.stop()
    thread.join(30.0)
    assert not thread.is_alive()
    assert "not running" in node.call("sim/step", StepSimulationRequest(1)).status_message


def test_contacts_are_published_at_100_hz_grouped_by_pair_while_there_are_any(node, robot):
    seen = []
    robot.plant.touching = [
        Contact("toy::two", "cube::cube_link", (0.0, 0.0, z), (0.0, 0.0, 1.0), 0.001, 5.0) for z in (0.0, 0.1)
    ] + [Contact("toy::one", "floor::link", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, 2.0)]
    registration = node.tap(lambda topic, message, now: seen.append(message) if topic == "/sim/contacts" else None)
    cycles(robot, 100)
    registration.unregister()
    assert len(seen) == 10
    assert [message.header.stamp.to_sec() for message in seen[:3]] == pytest.approx([0.0, 0.01, 0.02])
    first = seen[0].states[0]
    assert (first.collision1_name, first.collision2_name, len(first.wrenches)) == ("toy::two", "cube::cube_link", 2)
    assert first.total_wrench.force.z == 10.0
    assert [point.z for point in first.contact_positions] == [0.0, 0.1]
    assert seen[0].header.frame_id == "world"
    assert first.info == "rigid contact of toy::two on cube::cube_link"


def test_a_contact_by_spring_tells_its_kind_and_its_peak_since_the_message_before_also_when_it_is_over(node, robot):
    seen, pair = [], ("toy::two", "cube::cube_link")
    node.subscribe("sim/contacts", ContactsState, seen.append)
    robot.plant.touching = [Contact(*pair, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.001, 5.0, "penalty")]
    robot.plant.peaks = [{pair: 6.5}, {pair: 4.25}]
    cycles(robot, 5)
    robot.plant.touching = []
    cycles(robot, 40)
    first, second, last = seen
    assert [state.info for state in first.states] == ["penalty contact of toy::two on cube::cube_link; peak 6.5 N"]
    assert [state.total_wrench.force.z for state in first.states] == [5.0]
    (state,) = second.states
    assert state.info == "penalty contact of toy::two on cube::cube_link; peak 4.25 N"
    assert (state.wrenches, state.total_wrench.force.z, state.collision1_name) == ([], 0.0, "toy::two")
    assert last.states == []
    assert [contact_info.read(one.info) for one in (*first.states, state)] == [
        contact_info.ContactInfo("penalty", 6.5),
        contact_info.ContactInfo("penalty", 4.25),
    ]


def test_the_end_of_all_contacts_is_told_once(node, robot):
    seen = []
    node.subscribe("sim/contacts", ContactsState, seen.append)
    cycles(robot, 20)
    assert [len(message.states) for message in seen] == [0]  # there is none at the start
    robot.plant.touching = [Contact("toy::one", "floor::link", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0, 2.0)]
    cycles(robot, 20)
    robot.plant.touching = []
    cycles(robot, 40)
    assert [len(message.states) for message in seen] == [0, 1, 1, 0]


def test_model_states_tell_the_robot_and_the_models_at_10_hz(node, robot):
    seen = []
    spawn(node, pose=Pose(Point(1.0, 0.0, 0.5), Quaternion(0.0, 0.0, 0.0, 1.0)))
    node.subscribe("sim/model_states", ModelStates, seen.append)
    cycles(robot, 201)
    assert len(seen) == 3
    assert seen[-1].name == ["toy", "cube"]
    assert seen[-1].pose[1].position.z == 0.5
    assert seen[-1].pose[1].orientation.w == 1.0


def test_joint_loads_are_told_at_100_hz_while_somebody_listens(node, robot):
    seen = []
    cycles(robot, 20)
    node.subscribe("sim/joint_reactions", JointReactions, seen.append)
    cycles(robot, 100)
    assert [message.header.stamp.to_sec() for message in seen[:2]] == pytest.approx([0.02, 0.03])
    assert len(seen) == 10
    first = seen[0]
    assert (first.header.frame_id, first.joint_names, first.link_names) == ("world", ["j1"], ["one"])
    assert (first.positions[0].z, first.wrenches[0].force.z, first.wrenches[0].torque.y) == (1.0, 9.0, 2.0)


def test_efforts_of_the_motors_are_told_at_100_hz_while_somebody_listens(node, robot):
    seen = []
    node.subscribe("sim/motor_efforts", JointState, seen.append)
    cycles(robot, 100)
    assert len(seen) == 10
    assert (seen[0].name, seen[0].effort) == (list(robot.plant.joint_names), robot.plant.motor_effort())
