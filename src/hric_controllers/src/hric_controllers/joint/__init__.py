"""Joint-space PD and PID control."""
