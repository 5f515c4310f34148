"""Live view of a run: topics at a viewer's rate, limits as markers for rviz, a window with curves."""
