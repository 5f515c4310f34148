"""Metrics of recorded runs: robot motion, contacts, simulated human, marker tracking, sensor samples."""
