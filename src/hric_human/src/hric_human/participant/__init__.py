"""A human in the robot's plant: his body there, what moves it, what it holds, and his topics."""
