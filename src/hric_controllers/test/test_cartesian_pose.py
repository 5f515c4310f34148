"""The end effector follows a marker on the simulated arm, through the arm's own Cartesian motion generator."""

import logging
import math
import random

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from marker_rig import MarkerRig, sinusoid

from hric_core.errors import HricError
from hric_core.geometry import Pose, quaternions
from hric_msgs.msg import MocapData, RigidBodyState

NAME = "cartesian_pose_controller"
STATE = f"/{NAME}/state"
ACCELERATION, JERK, LAG = 2.0, 50.0, 0.098


def rig(way=sinusoid, **changes):
    return MarkerRig(NAME, way, **changes)


def still(time):
    return np.zeros(3)


def lines(caplog, level=logging.WARNING):
    return [record.getMessage() for record in caplog.records if record.levelno >= level]


def check_within_limits(path):
    """No step of the setpoint is beyond the limits."""
    assert np.linalg.norm(np.diff(path, n=2, axis=0), axis=1).max() <= ACCELERATION * 1e-6 * (1 + 1e-5)
    assert np.linalg.norm(np.diff(path, n=3, axis=0), axis=1).max() <= JERK * 1e-9 * (1 + 1e-2)


def send_pose(bench, position, quaternion, frame="panda_link0"):
    message = PoseStamped()
    message.header.frame_id = frame
    p, o = message.pose.position, message.pose.orientation
    p.x, p.y, p.z = position
    o.x, o.y, o.z, o.w = quaternion
    bench.publish("command", message)


def test_a_noisy_marker_is_followed_from_its_first_sample_on():
    bench = rig().follow(6.0)
    lag, rms, shaking = bench.figures(bench.measured)
    assert lag <= 0.15
    assert rms <= 2e-3
    assert shaking <= 1.5
    assert not bench.hw.error
    check_within_limits(bench.desired)
    last = bench.messages[STATE][-1]
    assert (last.tracking, last.losses, list(last.refused_reasons)) == ("following", 0, [])


def test_all_three_axes_are_followed_through_the_frame_rotation():
    def circle(time):
        angle = 2 * math.pi * 0.25 * time
        return np.array([0.04 * math.sin(angle), 0.06 * math.sin(angle + 1.0), 0.05 * math.cos(angle)])

    bench = rig(circle).follow(4.0)
    lag, rms, _ = bench.figures(bench.measured)
    assert lag <= 0.15 and rms <= 2e-3 and not bench.hw.error


def test_the_thesis_mode_moves_in_trapezoids_and_ignores_what_comes_meanwhile():
    bench = rig(mode="thesis").follow(4.0)
    state = bench.messages[STATE][-1]
    assert not bench.hw.error
    assert state.ignored > 500
    lag, rms, _ = bench.figures(bench.measured)
    assert lag <= 0.4 and rms <= 0.02
    acceleration = np.diff(bench.desired[:, 1], n=2) / 1e-6
    assert np.abs(acceleration).max() <= 2 * ACCELERATION * (1 + 1e-5)  # it may turn round from one cycle to the next
    assert np.mean(np.abs(np.abs(acceleration) - ACCELERATION) < 1e-3) > 0.5  # as a trapezoid does


def test_the_orientation_is_held_to_the_last_bit():
    bench = rig()
    before = bench.state.O_T_EE_c[:12]
    bench.follow(0.5)
    assert bench.hw.mode.generator is not None
    assert np.abs(np.subtract(bench.state.O_T_EE_c[:12], before)).max() < 1e-9
    assert bench.messages[STATE][-1].desired.orientation == bench.messages[STATE][0].desired.orientation


def test_points_as_in_the_thesis_lead_to_the_same_motion_as_frames():
    mocap, point = rig(noise=0.0, playout_margin=0.0).follow(1.0), rig(noise=0.0, source="point").follow(1.0)
    assert np.abs(mocap.desired - point.desired).max() < 1e-12
    assert np.ptp(mocap.desired[:, 1]) > 0.05


@pytest.mark.parametrize("source", ["mocap", "point"])
def test_in_an_occlusion_it_stops_within_its_limits_and_does_not_jump_on_return(source, caplog):
    with caplog.at_level(logging.INFO, "hric"):
        bench = rig(seen=lambda time: not 1.0 <= time < 1.5, source=source).follow(2.5)
    check_within_limits(bench.desired)
    resting = bench.desired[(bench.times > 1.3) & (bench.times < 1.5)]
    assert np.ptp(resting, axis=0).max() == 0.0
    # What the marker did unseen is left out; what it does afterwards is followed again.
    missed = sinusoid(1.5)[1] - sinusoid(1.0)[1]
    assert (bench.desired[-1] - resting[-1])[1] == pytest.approx(sinusoid(2.5 - LAG)[1] - sinusoid(1.5)[1], abs=3e-3)
    assert abs(missed) > 0.02
    said = [text for text in lines(caplog, logging.INFO) if "marker" in text]
    assert (
        len(said) == 3
        and "first valid marker" in said[0]
        and "is lost: no valid sample for 10" in said[1]
        and "new origins" in said[2]
    )
    seen = [message.tracking for message in bench.messages[STATE]]
    assert [one for one, before in zip(seen, ["", *seen], strict=False) if one != before] == [
        "waiting",
        "following",
        "lost",
        "following",
    ]
    assert bench.messages[STATE][-1].losses == 1 and not bench.hw.error


def test_on_return_it_can_catch_up_within_its_limits():
    bench = rig(seen=lambda time: not 1.0 <= time < 1.5, on_return="catch_up").follow(2.5)
    check_within_limits(bench.desired)
    assert bench.desired[-1][1] - bench.desired[0][1] == pytest.approx(sinusoid(2.5 - LAG)[1], abs=3e-3)


def test_the_thesis_mode_too_stops_in_an_occlusion_and_goes_on_after_it():
    bench = rig(seen=lambda time: not 0.6 <= time < 1.0, mode="thesis").follow(1.5)
    assert np.ptp(bench.desired[(bench.times > 0.9) & (bench.times < 1.0)], axis=0).max() == 0.0
    assert abs(bench.desired[-1][1] - bench.desired[950][1]) > 0.01 and not bench.hw.error
    assert bench.messages[STATE][-1].losses == 1


def test_a_commanded_pose_is_reached_and_the_next_marker_is_a_first_one():
    bench = rig(still, noise=0.0)
    start = bench.state.O_T_EE_c[:]
    goal = [start[12] + 0.05, start[13] - 0.1, start[14] + 0.08]
    quaternion = quaternions.product(
        quaternions.from_rotation_vector((0.1, -0.2, 0.3)), Pose.of_column_major(start).orientation
    )
    bench.follow(0.2)
    send_pose(bench, goal, quaternion)
    bench.follow(0.1)
    assert bench.messages[STATE][-1].tracking == "commanded"
    bench.follow(2.0)
    assert bench.state.O_T_EE_c[12:15] == pytest.approx(goal, abs=1e-9)
    assert quaternions.difference(Pose.of_column_major(bench.state.O_T_EE_c).orientation, quaternion) == pytest.approx(
        (0.0, 0.0, 0.0), abs=1e-6
    )
    assert bench.messages[STATE][-1].tracking == "following" and not bench.hw.error
    assert np.abs(bench.measured[-1] - goal).max() < 1e-3


BAD_POSES = {
    "outside of the workspace": ((2.0, 0.0, 0.5), (1.0, 0.0, 0.0, 0.0), "panda_link0"),
    "not finite": ((math.nan, 0.0, 0.5), (1.0, 0.0, 0.0, 0.0), "panda_link0"),
    "is not a unit quaternion": ((0.4, 0.0, 0.5), (1.0, 1.0, 0.0, 0.0), "panda_link0"),
    "valid: panda_link0": ((0.4, 0.0, 0.5), (1.0, 0.0, 0.0, 0.0), "mocap"),
    "largest_turn": ((0.4, 0.0, 0.5), (0.0, 0.0, 0.0, 1.0), "panda_link0"),
}


@pytest.mark.parametrize("reason", BAD_POSES)
def test_a_pose_that_cannot_be_is_refused_with_the_reason_and_nothing_moves(reason, caplog):
    bench = rig(still, source="none")
    before = bench.state.O_T_EE_c[12:15]
    send_pose(bench, *BAD_POSES[reason])
    bench.follow(0.05)
    assert any(reason in text for text in lines(caplog, logging.ERROR))
    assert bench.state.O_T_EE_c[12:15] == before


def test_with_follow_pose_the_end_effector_turns_with_the_body():
    bench = rig(still, noise=0.0, follow="pose")
    start = Pose.of_column_major(bench.state.O_T_EE_c).orientation
    bench.follow(0.1)
    message = MocapData(rigid_bodies=[RigidBodyState(name="hand", tracking_valid=True)])
    body = message.rigid_bodies[0].pose
    body.position.x, body.position.y, body.position.z = 1.0, 1.2, -0.5
    body.orientation.x, body.orientation.y, body.orientation.z, body.orientation.w = quaternions.from_rotation_vector(
        (0.0, 0.3, 0.0)
    )
    bench.run(1.5, lambda time: bench.marker.publish(message))
    assert quaternions.difference(Pose.of_column_major(bench.state.O_T_EE_c).orientation, start) == pytest.approx(
        (0.0, 0.0, 0.3), abs=1e-6
    )
    assert not bench.hw.error


def test_damaged_frames_cause_no_jump_and_are_counted_by_reason():
    """Each field of a frame is spoiled at random, between good ones."""
    rng, bench, values = random.Random(3), rig(), (math.nan, math.inf, -math.inf, 1e300, -1e30, 1e-300, 5.0, 0.0)

    def spoil(time):
        message = MocapData(rigid_bodies=[RigidBodyState(name="hand", tracking_valid=rng.random() < 0.9)])
        message.header.stamp.secs = rng.choice((0, 1, 4_000_000_000))
        message.header.frame_id = rng.choice(("mocap", "panda_link0", "", "\x00"))
        pose = message.rigid_bodies[0].pose
        pose.position.x, pose.position.y, pose.position.z = (rng.choice(values) for _ in range(3))
        if rng.random() < 0.1:
            message.rigid_bodies = []
        if rng.random() < 0.3:
            bench.marker.publish(message)
        bench._on_cycle(time)

    bench.run(3.0, spoil)
    desired = np.array([row[1] for row in bench.rows])
    check_within_limits(desired)
    state = bench.messages[STATE][-1]
    assert len(state.refused_reasons) >= 4 and sum(state.refused_counts) > 200
    assert not bench.hw.error


def test_a_body_that_is_not_there_is_reported_once_with_those_that_are(caplog):
    bench = rig(body="head").follow(0.1)
    assert sum("no rigid body head" in text and "it has: hand" in text for text in lines(caplog)) == 1
    assert bench.messages[STATE][-1].tracking == "waiting"


def test_after_a_restart_it_waits_for_a_first_marker_again():
    bench = rig().follow(0.5)
    bench.run(0.003, reset=True)
    assert bench.messages[STATE][-1].tracking == "waiting"


def test_a_start_outside_of_the_workspace_is_refused_with_both():
    with pytest.raises(HricError, match=r"the end effector is at \(0.307.*outside of the workspace \(x -0.85 to 0.2"):
        rig(workspace={"lower": [-0.85, -0.85, 0.02], "upper": [0.2, 0.85, 1.2]}).follow(0.01)


BAD_PARAMETERS = {
    "source": "camera",
    "mode": "fast",
    "follow": 1,
    "on_return": "jump",
    "target_marker": 3,
    "frame_rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
    "workspace": {"lower": [1, 0, 0], "upper": [0, 1, 1]},
    "workspace/upper": {"workspace": {"upper": [1, 2]}},
    "translation/velocity": {"translation": {"velocity": 9.0}},
    "rotation/jerk": {"rotation": {"jerk": -1}},
    "lost_after": -0.1,
    "largest_turn": 3.5,
    "arm_id": "",
}


@pytest.mark.parametrize("name", BAD_PARAMETERS)
def test_a_parameter_that_cannot_be_is_refused_by_its_full_name(name):
    value = BAD_PARAMETERS[name]
    changes = value if "/" in name else {name: value}
    with pytest.raises(HricError, match=f"/{NAME}/{name}"):
        rig(still, **changes)


def test_a_point_has_no_attitude_to_follow():
    with pytest.raises(HricError, match="a point has no orientation"):
        rig(still, source="point", follow="pose")
