"""What is seen of the human beside the robot."""
