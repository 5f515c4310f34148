"""The emulated control box of the arm: no ROS, no engine."""
