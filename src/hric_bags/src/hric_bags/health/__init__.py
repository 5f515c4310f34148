"""Health of bags: damage, rates, gaps, order, clock, and remains of a killed recorder; needs no ROS."""
