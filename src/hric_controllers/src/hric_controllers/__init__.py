"""Control laws: joint state, Franka state, joint PD, joint trajectory."""
