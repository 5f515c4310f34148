"""Samplers, which choose the points of the runs of a sweep: one module per family."""
