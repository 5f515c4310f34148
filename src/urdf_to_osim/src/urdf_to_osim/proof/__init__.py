"""Verification of a conversion: the model compared with oracles and closed forms."""
