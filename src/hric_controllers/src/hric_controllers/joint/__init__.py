"""Joint-space PD control."""
