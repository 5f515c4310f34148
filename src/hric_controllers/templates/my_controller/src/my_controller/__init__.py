"""My own controller."""
