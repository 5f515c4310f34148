"""What the outputs of a sweep say: probabilities, sensitivities, ranks."""
