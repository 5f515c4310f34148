"""Human participant of the robot's plant: body, control, grips and topics."""
