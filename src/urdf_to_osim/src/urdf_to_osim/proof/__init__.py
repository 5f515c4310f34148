"""Whether a conversion is right: the model against oracles and closed forms."""
