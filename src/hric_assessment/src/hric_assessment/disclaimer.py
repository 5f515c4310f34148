"""Disclaimer of everything that is assessed, which needs no table."""

DISCLAIMER = (
    "Estimate of a model: no risk assessment (ISO 12100), no proof of conformity, no measurement (ISO/PAS 5672), "
    "no certified safety function."
)
"""Disclaimer that is printed with the findings."""
