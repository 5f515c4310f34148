"""Example client of the gripper: homes, moves, grasps, stops and commands, and prints results and finger positions as
JSON."""

import json
from typing import Any

import actionlib
import rospy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from control_msgs.msg import GripperCommandAction, GripperCommandGoal
from franka_gripper.msg import (
    GraspAction,
    GraspGoal,
    HomingAction,
    HomingGoal,
    MoveAction,
    MoveGoal,
    StopAction,
    StopGoal,
)

LIMIT = rospy.Duration(60.0)


def client(name: str, action: type) -> Any:
    made = actionlib.SimpleActionClient(f"franka_gripper/{name}", action)
    assert made.wait_for_server(LIMIT), f"no action franka_gripper/{name}"
    return made


def ended(talker: Any, goal: Any) -> list[Any]:
    """Return the status of the goal, and whether its result reports success."""
    talker.send_goal(goal)
    assert talker.wait_for_result(LIMIT), "the goal does not end"
    result = talker.get_result()
    return [talker.get_state(), bool(getattr(result, "success", getattr(result, "reached_goal", False)))]


def main() -> None:
    rospy.init_node("gripper_client", anonymous=True)
    rospy.sleep(0.01)  # before the first message on /clock time is 0, and timeouts from there could be over at once
    fingers: list[float] = []
    frames: dict[str, list[float]] = {"panda_leftfinger": [], "panda_rightfinger": []}

    def heard(message: JointState) -> None:
        if "panda_finger_joint1" in message.name:
            fingers.append(message.position[message.name.index("panda_finger_joint1")])

    def seen(message: TFMessage) -> None:
        for item in message.transforms:
            if item.child_frame_id in frames:
                frames[item.child_frame_id].append(abs(item.transform.translation.y))

    rospy.Subscriber("joint_states", JointState, heard)
    rospy.Subscriber("/tf", TFMessage, seen)
    move, grasp, command = (
        client("move", MoveAction),
        GraspGoal(width=0.02, speed=0.1, force=10.0),
        GripperCommandGoal(),
    )
    grasp.epsilon.inner = grasp.epsilon.outer = 0.005
    command.command.position = 0.03
    found = {
        "homing": ended(client("homing", HomingAction), HomingGoal()),
        "move": ended(move, MoveGoal(width=0.05, speed=0.1)),
        "grasp of nothing": ended(client("grasp", GraspAction), grasp),
        "gripper_action": ended(client("gripper_action", GripperCommandAction), command),
    }
    move.send_goal(MoveGoal(width=0.01, speed=0.005))
    rospy.sleep(1.0)
    found["stop"] = ended(client("stop", StopAction), StopGoal())
    assert move.wait_for_result(LIMIT)
    found["stopped move"] = [move.get_state(), bool(move.get_result().success)]
    rospy.sleep(0.5)
    print(
        json.dumps(
            {
                "ended": found,
                "fingers": [min(fingers), max(fingers), fingers[-1]],
                "frames": [values[-1] for values in frames.values()],
            }
        )
    )


main()
