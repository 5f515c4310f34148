"""Controllers: joint state, Franka state, joint PD, Cartesian impedance, joint trajectory."""
