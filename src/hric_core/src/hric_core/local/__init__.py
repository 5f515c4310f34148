"""Replacement of ROS within one process, without a master: nodes, topics, services and actions."""
