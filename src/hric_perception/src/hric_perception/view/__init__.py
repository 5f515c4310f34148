"""What people look at while a run goes on: topics at a rate that viewers take, limits as markers for rviz, a window
with curves."""
