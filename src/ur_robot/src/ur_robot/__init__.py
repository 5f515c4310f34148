"""Arms of Universal Robots as a RobotHW through ur_rtde, and an emulated controller for ur_rtde."""
