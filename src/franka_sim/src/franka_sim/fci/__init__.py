"""Franka Control Interface of the control box, protocols 5 (Panda) and 10 (FR3), for an unmodified libfranka."""
