"""Command check_model: compares the robot model with the log of an arm, with functions of `franka_hw_interface`."""
