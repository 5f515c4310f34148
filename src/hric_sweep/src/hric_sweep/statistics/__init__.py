"""Statistics of the outputs of a sweep: probabilities, sensitivities, rank correlations."""
