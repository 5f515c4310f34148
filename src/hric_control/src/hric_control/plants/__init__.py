"""What every plant needs and no engine knows: worlds, wrenches, friction, stops, the description as a tree, checks of parameters."""
