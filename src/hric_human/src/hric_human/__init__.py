"""The human beside the robot; see `hric_human.body`."""
