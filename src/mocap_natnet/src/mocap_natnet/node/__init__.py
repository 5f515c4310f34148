"""The nodes of motion capture."""
