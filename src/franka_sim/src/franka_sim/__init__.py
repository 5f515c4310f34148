"""Simulated Franka arm as a RobotHW on any physics plant."""
