"""Reading, examining and exporting ROS bags and run folders, without ROS."""
