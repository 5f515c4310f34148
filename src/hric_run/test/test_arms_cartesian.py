"""Controllers of several arms with their Franka interfaces: state, model and Cartesian commands of each arm."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped

from hric_core.errors import HricError
from hric_core.geometry.transforms import inverse
from hric_run.definition import experiment
from hric_run.simulation import Simulation

DUAL = "franka_example_controllers/DualArmCartesianImpedanceExampleController"
GAINS = {"translational_stiffness": 800.0, "rotational_stiffness": 40.0}
SPACING = 0.4
"""Distance of the bases along y [m]."""


def two_arms(name: str, parameters: dict[str, Any], *own: str) -> Simulation:
    """Return a simulation of two arms and one controller of their common manager; own: further ones of each arm."""
    arms = {
        arm: {
            "robot": {"description": {"xyz": [0.0, 0.5 * side * SPACING, 0.0]}, "parameters": {"rate_limiting": False}},
            "controllers": ["joint_state_controller", "franka_state_controller", *own],
        }
        for arm, side in (("left", 1.0), ("right", -1.0))
    }
    raw = {
        "robot": {"hw": "franka_sim/FrankaHWSim", "plant_type": "mujoco_ros_control/MujocoPlant"},
        "controllers": ["joint_state_controller", name],
        "parameters": {name: parameters},
        "arms": arms,
        "duration": 4.0,
    }
    return Simulation(experiment.parse("arms", raw))


def dual() -> Simulation:
    sides = {
        arm: {"arm_id": arm, "joint_names": [f"{arm}_joint{k}" for k in range(1, 8)], **GAINS}
        for arm in ("left", "right")
    }
    return two_arms("dual", {"type": DUAL, "largest_turn": 1.0, **sides})


def hands(both: Simulation) -> list[np.ndarray]:
    """Return the poses of both hands in the world, shape (4, 4), from the physics engine."""
    return [np.array(both.app.hw.plant.link_state(f"{arm}_hand")[0]) for arm in ("left", "right")]


def target(x: float, y: float, z: float, turned: float = 0.0) -> PoseStamped:
    """Return a pose in the base of the left arm, whose z axis points down, turned about the vertical [rad]."""
    message = PoseStamped()
    message.header.frame_id = "left_link0"
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x, y, z
    message.pose.orientation.x, message.pose.orientation.y = np.cos(0.5 * turned), np.sin(0.5 * turned)
    return message


def test_both_hands_follow_their_centring_frame_and_keep_their_distance() -> None:
    with dual() as both:
        seen: list[PoseStamped] = []
        both.node.subscribe("dual/centering_frame", PoseStamped, seen.append)
        sender = both.node.advertise("dual/centering_frame_target_pose", PoseStamped)
        both.run(0.2)
        at, before = seen[-1].pose.position, hands(both)
        assert (at.y, seen[-1].header.frame_id) == (pytest.approx(-0.5 * SPACING, abs=1e-3), "left_link0")
        sender.publish(target(at.x - 0.04, at.y + 0.05, at.z + 0.03, turned=0.3))
        between = inverse(before[0]) @ before[1]
        for _ in range(30):
            both.run(0.1)
            left, right = hands(both)
            assert np.linalg.norm(right[:3, 3] - left[:3, 3]) == pytest.approx(SPACING, abs=0.015)
    np.testing.assert_allclose(inverse(left) @ right, between, atol=2e-3)
    middle = 0.5 * (left[:3, 3] + right[:3, 3]) - 0.5 * (before[0][:3, 3] + before[1][:3, 3])
    np.testing.assert_allclose(middle, [-0.04, 0.05, 0.03], atol=2e-3)
    turned = left[:3, :3] @ before[0][:3, :3].T
    assert np.arctan2(turned[1, 0], turned[0, 0]) == pytest.approx(0.3, abs=0.02)


def test_a_target_of_another_frame_or_too_far_away_is_refused(caplog: pytest.LogCaptureFixture) -> None:
    with dual() as both:
        sender = both.node.advertise("dual/centering_frame_target_pose", PoseStamped)
        both.run(0.1)
        before = hands(both)
        far, foreign = target(2.0, 0.0, 0.5), target(0.3, 0.0, 0.5)
        foreign.header.frame_id = "right_link0"
        for message in (far, foreign):
            sender.publish(message)
            both.run(0.3)
        np.testing.assert_allclose(hands(both), before, atol=1e-3)
    assert "m from the present equilibrium" in caplog.text and "valid: left_link0" in caplog.text


def test_a_robot_with_one_arm_is_refused() -> None:
    with pytest.raises(HricError, match="has one Franka arm, panda_robot; valid: a robot with two"):
        raw = {
            "robot": {"hw": "franka_sim/FrankaHWSim"},
            "controllers": ["dual"],
            "parameters": {"dual": {"type": DUAL}},
        }
        Simulation(experiment.parse("one", raw | {"duration": 1.0}))


def test_a_reflex_of_one_arm_stops_both() -> None:
    with dual() as both:
        both.run(0.1)
        hw = both.app.hw
        hw.plant.apply_wrench("right_hand", (0.0, 0.0, 150.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.05)
        both.run(0.3)
        assert hw.error == "right: the motion was aborted: cartesian_reflex"
        assert both.signals.interfaces == ("none",) * 14


@pytest.mark.parametrize(("arm", "other"), [("left", "right"), ("right", "left")])
def test_pose_commands_of_the_common_manager_move_their_arm(arm: str, other: str) -> None:
    kind = "franka_example_controllers/ElbowExampleController"
    with two_arms("elbow", {"type": kind, "arm_id": arm}) as both:
        both.run(3.0)
        assert both.app.hw.error == ""
    moved = np.ptp(both.signals.position, axis=0)
    columns = {"left": moved[:7], "right": moved[7:]}
    assert columns[arm].max() > 0.2 and columns[other].max() < 1e-3


def test_pose_commands_and_a_controller_of_the_arm_exclude_each_other() -> None:
    kind = "franka_example_controllers/ElbowExampleController"
    with pytest.raises(HricError, match=r"right_joint1 to right_joint7 are claimed by both .*elbow \(Cartesian pose\)"):
        two_arms("elbow", {"type": kind, "arm_id": "right"}, "joint_pd_controller").close()
