"""Topics of a simulated robot about the world around it, with the real plants."""

import math

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Point, Pose, Quaternion
from two_link import transmission, two_link_urdf

from gazebo_msgs.msg import ContactsState, ModelStates
from gazebo_msgs.srv import SpawnModelRequest
from hric_control.sim import contact_info, services
from hric_control.sim.robot_hw_sim import RobotHWSim
from hric_core.geometry.transforms import rotation_from_quaternion, transform_from_rpy
from hric_core.local.node import LocalNode
from hric_core.scoped_node import ScopedNode

URDF_OBJECT = """<robot name="part"><link name="stand"><inertial><origin xyz="0 0 0.3"/><mass value="0.5"/>
<inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


@pytest.fixture
def make_robot(plant_type, tmp_path):
    robots = []

    def make(*objects, **plant):
        world = tmp_path / "world.yaml"
        world.write_text(yaml.safe_dump({"objects": list(objects)}))
        urdf = two_link_urdf(
            transmissions=transmission("joint1", "EffortJointInterface")
            + transmission("joint2", "EffortJointInterface")
        )
        parameters = {
            "real_time_factor": 0.0,
            "plant_type": plant_type,
            "plant": {"world": str(world), "gravity": [0.0, 0.0, 0.0], **plant},
        }
        node = LocalNode({"robot_description": urdf, "robot": parameters})
        hw = RobotHWSim()
        hw.init(node, node.child("robot"))
        node.clock = lambda: hw.loop.time
        offered = ScopedNode(node)
        services.SimServices(hw, offered)
        robots.append((hw, offered))
        return hw, node

    yield make
    for hw, offered in robots:
        offered.close()
        hw.shutdown()


def cycles(hw, n):
    end = hw.loop.cycles + n

    def on_cycle(time, period, reset):
        if hw.loop.cycles + 1 >= end:
            hw.stop()
        return True

    hw.run(on_cycle)


def matrix(pose):
    T = np.eye(4)
    T[:3, :3] = rotation_from_quaternion(
        [pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w]
    )
    T[:3, 3] = pose.position.x, pose.position.y, pose.position.z
    return T


def test_objects_of_a_world_file_are_where_they_are_also_after_they_moved(make_robot, tmp_path):
    (tmp_path / "part.urdf").write_text(URDF_OBJECT)
    start = {
        "box": ([2.0, 0.5, 0.3], [0.1, 0.2, 0.3]),
        "ball": ([3.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
        "part": ([4.0, -1.0, 0.7], [0.0, 0.0, 0.5]),
        "floor": ([0.0, 0.0, -1.0], [0.0, 0.0, 0.0]),
    }
    shapes = {
        "box": {"shape": "box", "size": [0.2, 0.3, 0.4]},
        "ball": {"shape": "sphere", "size": 0.05, "mass": 1.0, "velocity": {"linear": [0.5, -1.0, 2.0]}},
        "part": {"shape": "urdf", "urdf": "part.urdf", "mass": 0.5, "velocity": {"linear": [0.0, 0.2, 0.0]}},
        "floor": {"shape": "plane"},
    }
    hw, node = make_robot(
        *({"name": name, **shapes[name], "pose": {"xyz": xyz, "rpy": rpy}} for name, (xyz, rpy) in start.items())
    )
    seen = []
    node.subscribe("sim/model_states", ModelStates, seen.append)
    spawned = SpawnModelRequest("late", URDF_OBJECT, "", Pose(Point(5.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)), "")
    assert node.call("sim/spawn_urdf_model", spawned).success
    cycles(hw, 301)
    first, last = seen[0], seen[-1]
    assert last.name == ["planar", "box", "ball", "part", "floor", "late"]
    placed = dict(zip(first.name, first.pose, strict=True))
    for name, (xyz, rpy) in start.items():
        assert np.abs(matrix(placed[name]) - transform_from_rpy(xyz, rpy)).max() < 5e-3
    moved = {name: (matrix(pose), twist) for name, pose, twist in zip(last.name, last.pose, last.twist, strict=True)}
    apart = hw.loop.time - 0.1 * math.floor(hw.loop.time / 0.1 + 1e-9)
    assert apart < 2e-3
    assert moved["ball"][0][:3, 3] == pytest.approx(
        np.array([3.0, 0.0, 1.0]) + 0.3 * np.array([0.5, -1.0, 2.0]), abs=3e-3
    )
    assert (moved["ball"][1].linear.x, moved["ball"][1].linear.z) == pytest.approx((0.5, 2.0))
    assert moved["part"][0][:3, 3] == pytest.approx([4.0, -0.94, 0.7], abs=1e-3)
    assert moved["late"][0][:3, 3] == pytest.approx([5.0, 0.0, 0.0], abs=1e-6)
    assert np.abs(moved["box"][0] - transform_from_rpy(*start["box"])).max() < 1e-6


def test_an_impact_between_two_messages_is_told_with_its_kind_and_its_true_peak(make_robot):
    """Check a contact of 8.9 ms (0.6 kg at 0.25 m/s on 75 N/mm), which samples every 10 ms may miss."""
    ball = {
        "name": "ball",
        "shape": "sphere",
        "size": 0.05,
        "mass": 0.6,
        "friction": 0.0,
        "velocity": {"linear": [0.25, 0.0, 0.0]},
    }
    wall = {
        "name": "wall",
        "shape": "box",
        "size": [1.0, 1.0, 1.0],
        "pose": {"xyz": [2.5, 0.0, 1.0]},
        "contact": "penalty",
    }
    hw, node = make_robot({**ball, "pose": {"xyz": [1.948, 0.0, 1.0]}}, wall)
    seen = []
    node.subscribe("sim/contacts", ContactsState, seen.append)
    cycles(hw, 60)
    told = [contact_info.read(state.info) for message in seen for state in message.states]
    assert {info.kind for info in told} == {"penalty"}
    assert max(info.peak for info in told) == pytest.approx(0.25 * math.sqrt(0.6 * 75000.0), rel=0.01)
