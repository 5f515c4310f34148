"""Simulated robots: control loop, services and topics, and a RobotHW for any URDF with transmissions."""
