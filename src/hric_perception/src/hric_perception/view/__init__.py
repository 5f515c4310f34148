"""Live view of a run: decimated topics, limits as markers for rviz, and a window with curves."""
