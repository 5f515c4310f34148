"""Samplers, which choose the values of the variables for the runs of a sweep: one module per family."""
