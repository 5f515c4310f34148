"""Controllers that yield to the force at the end effector."""
