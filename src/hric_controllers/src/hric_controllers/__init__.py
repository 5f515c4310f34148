"""Controllers: joint state, Franka state, joint PD, Cartesian impedance, joint trajectory."""

from hric_core import former_names

former_names.install()
