"""Reading runs and bags without ROS: parts, run folders, health, export."""
