"""Command line, live experiments, recorder, and check of the robot model."""
