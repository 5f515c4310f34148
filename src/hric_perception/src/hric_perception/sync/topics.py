"""Where synchronised samples go."""

from __future__ import annotations

TOPIC = "/hric/perception/sync"


def rate_topic(topic: str, rate: float) -> str:
    """Where samples of one rate of several go, such as /hric/perception/sync_100hz."""
    return f"{topic}_{f'{rate:g}'.replace('.', '_')}hz"
