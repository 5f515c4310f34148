"""Measurement of the emulated arm's stopping time and distance, by speed and load."""
