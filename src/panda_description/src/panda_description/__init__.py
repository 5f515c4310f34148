"""The Franka Panda as xacro, with identified dynamics, friction and limits in YAML, and tools for inertial parameters."""
