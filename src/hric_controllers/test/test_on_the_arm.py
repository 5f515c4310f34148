"""The controllers with the shipped configuration on the simulated arm."""

import importlib.util
import itertools
import logging
import math
from pathlib import Path

import pytest
import yaml
from arm_rig import ArmRig
from genpy import Duration
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectoryPoint

import panda_description
from control_msgs.msg import FollowJointTrajectoryGoal
from hric_control.manager.controller_manager import ControllerManager
from hric_control.plant import Load
from hric_core import plugins
from hric_core.errors import HricError
from hric_core.local.node import LocalNode

YAML = Path(__file__).parents[2] / "hric_bringup" / "config" / "controllers.yaml"
ARM = [f"panda_joint{i}" for i in range(1, 8)]
START = [0.0, 0.0, 0.0, -0.08, 0.0, 0.0, 0.0]
GOAL = [0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4]


def configured(arm_id="panda"):
    return yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", arm_id))


class ArmLab:
    def __init__(self, **changes):
        params = configured()
        for name, values in changes.items():
            params[name].update(values)
        params["robot_description"] = panda_description.load(arm_id="panda", meshes=False)
        params["robot"] = {
            "arm_id": "panda",
            "real_time_factor": 0.0,
            "q_start": START,
            "plant": {"collision": False, "self_collision": False},
        }
        self.node = LocalNode(params)
        self.hw = plugins.find(plugins.ROBOT_HW, "franka_sim/FrankaHWSim")()
        self.hw.init(self.node, self.node.child("robot"))
        self.node.clock = lambda: self.hw.loop.time
        self.manager = ControllerManager(self.hw, self.node)
        self.manager.loop_running = False
        self.torques = []

    def load(self, name):
        self.manager.load(name)
        self.manager.switch([name], [])
        return self

    def run(self, seconds):
        end = self.hw.loop.time + seconds - 5e-4

        def on_cycle(time, period, reset):
            self.manager.update(time, period, reset)
            self.torques.append(list(self.hw.robot_state.tau_J_d))
            if time >= end:
                self.hw.stop()
            return True

        self.hw.run(on_cycle)
        return self

    def error(self):
        return max(abs(q - goal) for q, goal in zip(self.hw.states.position, GOAL, strict=True))

    def chatter(self):
        """Largest change of torque between two cycles in the last half second [N m]."""
        last = self.torques[-500:]
        return max(abs(b - a) for one, two in itertools.pairwise(last) for a, b in zip(one, two, strict=True))

    def goal(self, controller, seconds):
        point = JointTrajectoryPoint(
            positions=GOAL, velocities=[0.0] * 7, accelerations=[0.0] * 7, time_from_start=Duration.from_sec(seconds)
        )
        message = FollowJointTrajectoryGoal()
        message.trajectory.joint_names, message.trajectory.points = ARM, [point]
        return self.node.send_goal(f"{controller}/follow_joint_trajectory", message)


def test_every_configured_controller_loads_for_any_arm_id_without_a_warning(caplog):
    with caplog.at_level(logging.WARNING, "hric"):
        bench = ArmLab()
        for name in configured():
            if name != "policy_controller" or importlib.util.find_spec("onnxruntime"):  # of the part `learning`
                bench.manager.load(name)
    assert not caplog.records
    assert "left_joint1" in configured("left")["joint_pd_controller"]["joints"]


def test_the_pd_controller_takes_the_arm_to_the_setpoint_of_the_thesis():
    bench = ArmLab().load("joint_pd_controller").run(0.1)
    bench.node.advertise("joint_pd_controller/command", Float64MultiArray).publish(Float64MultiArray(data=GOAL))
    bench.run(6.0)
    assert bench.error() < 1e-3
    assert bench.chatter() < 0.01


@pytest.mark.parametrize("kind", ["effort", "position"])
def test_a_trajectory_takes_the_arm_to_the_setpoint_of_the_thesis(kind):
    bench = ArmLab().load(f"{kind}_joint_trajectory_controller").run(0.1)
    client = bench.goal(f"{kind}_joint_trajectory_controller", 3.0)
    bench.run(4.0)
    assert client.status == "SUCCEEDED", client.result
    assert bench.error() < 1e-3
    assert bench.chatter() < 0.01


def test_gravity_true_is_refused_naming_arm_and_controller():
    bench = ArmLab(joint_pd_controller={"gravity": True})
    with pytest.raises(HricError, match="both the arm FrankaHWSim and the controller joint_pd_controller would add g"):
        bench.manager.load("joint_pd_controller")


def test_the_arms_state_and_its_joint_states_are_published():
    bench = ArmLab()
    seen = {}
    bench.node.tap(lambda topic, message, time: seen.setdefault(topic, message))
    for name in ("joint_state_controller", "franka_state_controller"):
        bench.load(name)
    bench.run(0.1)
    assert seen["/joint_states"].name == ARM
    assert list(seen["/franka_state_controller/franka_states"].q) == pytest.approx(START, abs=1e-4)
    assert [frame.child_frame_id for frame in seen["/tf"].transforms] == ["panda_NE", "panda_EE", "panda_K"]


@pytest.mark.parametrize(
    "name", ["cartesian_pose_controller", "cartesian_streaming_controller", "admittance_controller"]
)
def test_a_controller_started_between_two_runs_begins_where_a_payload_has_pulled_the_arm(name):
    rig = ArmRig(name, start=False)
    rig.hw.plant.set_load(Load(1.5, (0.0, 0.0, 0.1)))
    rig.run(1.0)
    rig.manager.switch([name], [])
    rig.run(0.02)
    assert rig.hw.error == "" and rig.state.O_T_EE_c == pytest.approx(rig.state.O_T_EE_d, abs=1e-6)


def test_a_stream_begins_at_the_last_command_of_an_arm_that_a_payload_pulls_down():
    before, after = "position_joint_trajectory_controller", "joint_streaming_controller"
    rig = ArmRig(before)
    rig.manager.load(after)
    rig.hw.plant.set_load(Load(1.0, (0.0, 0.0, 0.1)))
    rig.run(1.0)
    desired = list(rig.state.q_d)
    assert abs(rig.state.q[3] - desired[3]) > 1e-3
    rig.manager.switch([after], [before])
    rig.run(0.5)
    assert rig.state.q_d == pytest.approx(desired, abs=1e-9)
