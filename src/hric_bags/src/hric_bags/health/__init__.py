"""Whether a bag is whole and its streams are: rates, gaps, order, clock, and what a killed recorder left; needs no
ROS."""
