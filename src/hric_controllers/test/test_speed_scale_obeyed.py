"""Controllers with a speed scale: the path does not change, its duration does, and at 0 nothing moves."""

import math

import numpy as np
import pytest
from arm_rig import ArmRig
from controllers_rig import DT, Lab
from genpy import Duration
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from hric_control.speed_scale import ScaleRequest, SpeedScaleInterface
from hric_controllers.cartesian.law import CartesianArmState, CartesianLaw, Compliance
from hric_controllers.marker.motion import LineMotion, MotionLimits, OnlineTrajectoryGenerator

GAINS = {joint: {"p": 400.0, "d": 40.0} for joint in ("a", "b")}
TRAJECTORY = {"effort": {"joints": ["a", "b"], "gains": GAINS}, "position": {"joints": ["a", "b"]}}


class Slowed(Lab):
    """A lab whose robot's scale follows `plan`, {time [s]: scale}."""

    def __init__(self, params, plan=(), **rig):
        super().__init__(params, **rig)
        self.plan, self.scales = dict(plan), []

    def run(self, seconds, reset=False):
        for _ in range(round(seconds / DT)):
            due = self.plan.pop(round(self.time, 6), None)
            if due is not None:
                self.hw.speed_scale.request(ScaleRequest(due))
            self.hw.speed_scale.advance(self.time, DT)
            self.scales.append(self.hw.speed_scale.value)
            super().run(DT)
        return self


def move():
    message = JointTrajectory(joint_names=["a", "b"])
    for time, place in ((0.5, 0.6), (1.0, -0.3)):
        at = JointTrajectoryPoint(positions=[place, -place], velocities=[0.0, 0.0], accelerations=[0.0, 0.0])
        at.time_from_start = Duration.from_sec(time)
        message.points.append(at)
    return message


def positions(kind, plan, seconds):
    lab = Slowed({"jt": {"type": f"{kind}_controllers/JointTrajectoryController", **TRAJECTORY[kind]}}, plan).load("jt")
    lab.run(0.01)
    lab.send("/jt/command", move())
    lab.run(seconds)
    return np.array([row[3 if kind == "position" else 1] for row in lab.history]), np.array(lab.scales), lab


def test_a_trajectory_is_the_same_path_over_a_time_that_stretches():
    free, _, _ = positions("position", {}, 1.1)
    slowed, scales, _ = positions("position", {0.2: 0.3, 1.4: 0.0, 2.2: 1.0}, 4.0)
    along = np.arange(len(scales)) * DT - np.cumsum(1.0 - scales) * DT
    expected = np.interp(along, np.arange(len(free)) * DT, free[:, 0])
    # Between the cycles of the run that is not slowed it is known to 4e-5 only: a v dt of the chord.
    assert np.abs(slowed[:, 0] - expected).max() < 1e-4
    standing = slowed[np.flatnonzero(scales == 0.0)[2:]]
    assert len(standing) > 200 and np.ptp(standing, axis=0).max() == 0.0
    assert slowed[-1] == pytest.approx([-0.3, 0.3], abs=1e-9)


def test_the_effort_version_follows_the_slowed_motion_as_well_as_the_free_one():
    def error(plan, seconds):
        _, _, lab = positions("effort", plan, seconds)
        states = lab.published("/jt/state")
        return max(abs(value) for state in states for value in state.error.positions)

    assert error({0.2: 0.3, 1.4: 0.0, 2.2: 1.0}, 4.0) <= error({}, 1.2) * 1.05


def test_the_slowed_desired_velocity_is_that_of_the_slowed_position():
    _, _, lab = positions("position", {0.2: 0.4}, 2.5)
    states = lab.published("/jt/state")
    place = np.array([state.desired.positions[0] for state in states])
    speed = np.array([state.desired.velocities[0] for state in states])
    period = float(np.median(np.diff([state.header.stamp.to_sec() for state in states])))
    assert np.abs(np.gradient(place, period) - speed)[20:].max() < 0.05 * np.abs(speed).max()


PD = {"type": "hric_controllers/JointPDController", "joints": ["a", "b"], "kp": 400.0, "kd": 40.0}


def test_a_pd_setpoint_is_led_along_the_same_line_and_stands_at_zero():
    lab = Slowed({"pd": {**PD, "state_publish_rate": 1000.0}}, {0.3: 0.0, 1.3: 1.0}).load("pd")
    lab.run(0.01)
    lab.send("/pd/command", Float64MultiArray(data=[1.0, -0.5]))
    lab.run(4.0)
    desired = np.array([state.desired.positions for state in lab.published("/pd/state")])
    assert np.ptp(desired[700:1250], axis=0).max() == 0.0
    # A straight line in the space of the joints, whatever the time along it.
    assert np.abs(desired[:, 1] + 0.5 * desired[:, 0]).max() < 1e-12
    assert desired[-1] == pytest.approx([1.0, -0.5])


def test_a_pd_controller_that_takes_raw_setpoints_does_not_declare_that_it_obeys():
    lab = Slowed({"pd": {**PD, "profile": {"enabled": False}}})
    lab.manager.load("pd")
    assert not lab.hw.get(SpeedScaleInterface).declared
    lab = Slowed({"pd": PD})
    lab.manager.load("pd")
    assert lab.hw.get(SpeedScaleInterface).declared


def test_a_marker_motion_goes_the_same_way_slower_and_rests_at_the_same_place():
    limits = MotionLimits(velocity=0.5, acceleration=2.0, jerk=50.0)

    def way(scale, seconds):
        motion, path = OnlineTrajectoryGenerator(limits), []
        motion.go([0.2, -0.1, 0.05])
        for _ in range(round(seconds / DT)):
            motion.advance(DT, scale)
            path.append(motion.position)
        return np.array(path), motion

    free, _ = way(1.0, 2.0)
    half, motion = way(0.5, 4.0)
    assert np.abs(half[1::2] - free).max() < 1e-6
    assert np.abs(np.diff(half, axis=0)).max() / DT <= 0.5 * 0.5 * (1 + 1e-9)
    assert motion.position == pytest.approx([0.2, -0.1, 0.05]) and not motion.moving
    still, motion = way(0.0, 0.5)
    assert np.ptp(still, axis=0).max() == 0.0 and motion.moving


def test_the_thesis_line_stands_at_zero_and_goes_on():
    motion = LineMotion(0.5, 2.0)
    motion.go([0.3, 0.0, 0.0])
    motion.advance(0.2)
    before = motion.position
    motion.advance(0.5, 0.0)
    assert motion.position == before
    for _ in range(3000):
        motion.advance(DT, 0.5)
    assert motion.position == [0.3, 0.0, 0.0]


def equilibrium(x, z):
    message = PoseStamped()
    message.header.frame_id = "panda_link0"
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x, 0.0, z
    message.pose.orientation.x = 1.0
    return message


@pytest.mark.parametrize("name", ["cartesian_impedance_controller", "cartesian_pose_controller"])
def test_the_arm_stands_where_the_scale_is_zero_and_reaches_its_goal_afterwards(name):
    rig = ArmRig(name, **({"source": "mocap"} if "pose" in name else {}))
    assert rig.hw.get(SpeedScaleInterface).declared
    start, scale = np.array(rig.state.O_T_EE[12:15]), rig.hw.speed_scale
    rig.run(0.05)
    scale.request(ScaleRequest(0.0))
    for k in range(500):
        scale.advance(k * DT, DT)
    goal = equilibrium(start[0] + 0.05, start[2])
    goal.pose.position.y = start[1]
    rig.publish("equilibrium_pose" if "impedance" in name else "command", goal)
    rig.run(0.5)
    assert np.abs(np.array(rig.state.O_T_EE[12:15]) - start).max() < 1e-4
    scale.request(ScaleRequest(1.0))
    rig.run(5.0, lambda time: scale.advance(time, DT))
    assert rig.state.O_T_EE[12] == pytest.approx(start[0] + 0.05, abs=2e-3)


def law(force_limit=math.inf):
    made = CartesianLaw(Compliance(500.0, 10.0, 1.0, 1.0, 0.0), 0.2)
    made.force_limit = force_limit
    return made


def force(made, displacement):
    from hric_core.geometry import Pose

    made.start(Pose(), [0.0] * 7)
    made.torque(
        Pose((displacement, 0.0, 0.0)), CartesianArmState([0.0] * 7, [0.0] * 7, np.eye(6, 7), np.eye(7), np.zeros(7))
    )
    return made.wrench[0]


def test_the_force_of_the_spring_is_cut_at_the_limit_and_below_it_is_as_before():
    assert force(law(), 0.1) == pytest.approx(-50.0)
    assert force(law(20.0), 0.1) == pytest.approx(-20.0)
    assert force(law(20.0), 0.03) == pytest.approx(-15.0)


def test_a_supervisor_softens_the_spring_and_the_users_stiffness_returns_with_its_end():
    rig = ArmRig("cartesian_impedance_controller", translational_stiffness=800.0)
    scale = rig.hw.speed_scale

    def stiffness():
        return rig.manager._loaded[rig.name].controller._law.compliance.translational_stiffness

    rig.run(0.1)
    assert stiffness() == 800.0
    scale.request(ScaleRequest(1.0, stiffness=150.0))
    rig.run(2.0, lambda time: scale.advance(time, DT))
    assert stiffness() == pytest.approx(150.0, abs=0.1)
    scale.request(ScaleRequest())
    rig.run(3.0, lambda time: scale.advance(time, DT))
    assert stiffness() == pytest.approx(800.0, abs=0.1)
