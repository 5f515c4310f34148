"""The control box on the network: the Franka Control Interface, protocols 5 (Panda) and 10 (FR3), to which an
unmodified libfranka connects."""
