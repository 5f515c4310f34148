"""Real Franka arm as a RobotHW, through libfranka."""
