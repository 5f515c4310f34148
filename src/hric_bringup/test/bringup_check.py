#!/usr/bin/env python3
"""Run by rostest beside bringup.launch: the chosen controllers run, states and transforms come, the arm stands
still."""

import unittest

import rospy
import rostest
import tf2_ros
from sensor_msgs.msg import JointState

from controller_manager_msgs.srv import ListControllers

RUNNING = {"joint_state_controller", "franka_state_controller", "position_joint_trajectory_controller"}
WAITING = "joint_pd_controller"


class Bringup(unittest.TestCase):
    def setUp(self) -> None:
        rospy.wait_for_service("controller_manager/list_controllers", 30.0)
        self.list = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)
        for _ in range(300):
            states = {item.name: item.state for item in self.list().controller}
            if all(states.get(name) == "running" for name in RUNNING) and WAITING in states:
                return
            rospy.rostime.wallsleep(0.1)
        self.fail(f"these do not all run: {sorted(RUNNING)}, or {WAITING} is not loaded; {states}")

    def test_only_the_chosen_controllers_run_and_the_others_wait(self) -> None:
        rospy.rostime.wallsleep(1.0)
        states = {item.name: item.state for item in self.list().controller}
        self.assertEqual({name for name, state in states.items() if state == "running"}, RUNNING)
        self.assertNotEqual(states[WAITING], "running")

    def arm_state(self) -> JointState:
        """The fingers come in messages of their own."""
        for _ in range(50):
            message = rospy.wait_for_message("joint_states", JointState, 10.0)
            if "panda_joint1" in message.name:
                return message
        self.fail("no message with the arm's joints")

    def test_the_hand_stands_where_the_joints_put_it_and_does_not_move(self) -> None:
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        first = self.arm_state()
        for _ in range(100):
            if buffer.can_transform("world", "panda_hand", rospy.Time(0)):
                break
            rospy.rostime.wallsleep(0.1)
        hand = buffer.lookup_transform("world", "panda_hand", rospy.Time(0)).transform.translation
        self.assertLess(0.1, abs(hand.x) + abs(hand.y) + abs(hand.z))
        rospy.rostime.wallsleep(1.0)
        second = self.arm_state()
        listener.unregister()
        for name, before, after in zip(first.name, first.position, second.position, strict=True):
            self.assertAlmostEqual(before, after, delta=1e-5, msg=name)


if __name__ == "__main__":
    rospy.init_node("bringup_check")
    rostest.rosrun("hric_bringup", "bringup", Bringup)
