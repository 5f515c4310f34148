"""Health checks of bags: damage, rates, gaps, order, clock, and bags that a killed recorder left. No ROS."""
