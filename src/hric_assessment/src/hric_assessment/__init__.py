"""Assessment of a recorded run for the person in it: safety of contacts and distance, and ergonomics. No ROS.

`tables` loads the published limits; `contact`, `separation` and `ergonomics` compare a run with them; `findings`
defines the results; `verdict` assesses a complete recording; `supervisor` watches the separation while an arm moves.
"""

DISCLAIMER = (
    "Estimate of a model: no risk assessment (ISO 12100), no proof of conformity, no measurement (ISO/PAS 5672), "
    "no certified safety function."
)
"""Disclaimer that is printed with the findings."""
