"""Experiment files (robot, controllers, setpoints, sensors), and their simulation in one process without ROS."""
