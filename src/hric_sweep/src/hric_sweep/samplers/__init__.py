"""Where the runs of a sweep are: one module per family of samplers."""
