"""State, model and Cartesian interfaces of the Franka arm, and its KDL model from the URDF."""
