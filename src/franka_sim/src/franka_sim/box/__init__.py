"""Emulated control box of the arm: no ROS, no physics engine."""
