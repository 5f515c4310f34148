"""Stops of the emulated arm, by speed and load."""
