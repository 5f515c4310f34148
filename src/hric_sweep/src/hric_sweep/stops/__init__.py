"""Stopping time and distance of the emulated arm, by speed and load."""
