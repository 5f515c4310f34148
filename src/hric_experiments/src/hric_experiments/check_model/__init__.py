"""The robot model against the log of an arm: reads the log, prints, draws, fits friction. What is computed is in
`franka_hw_interface`."""
