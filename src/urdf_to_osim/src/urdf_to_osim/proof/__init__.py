"""Verification of a conversion (the proof): comparison of the OpenSim model with pinocchio and with equations."""
