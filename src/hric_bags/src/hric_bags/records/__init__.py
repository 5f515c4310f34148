"""Readers of what a bag has on persons, contacts, objects and the safety supervisor, as arrays."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RecordedHumanEvent:
    """Event of a simulated person at a robot time [s], with the fields of hric_msgs/HumanEvent."""

    time: float
    kind: str
    name: str
    value: float
    text: str
