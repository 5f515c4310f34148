"""The real Franka arm as a RobotHW, through libfranka."""
