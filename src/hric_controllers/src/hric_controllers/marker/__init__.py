"""Following a marker: samples, filters, targets of the end effector."""
