"""A Trigno client from the parameters of a node."""

from __future__ import annotations

from collections.abc import Callable

from hric_control.errors import ParameterError
from hric_perception.chunk import Layout
from hric_perception.health import StreamHealth
from hric_perception.section import Section
from hric_perception.stream import SampleStream
from hric_perception.trigno.client import Settings, TrignoClient
from hric_perception.trigno.protocol import CHANNELS


def trigno_driver(section: Section, stream: SampleStream, health: StreamHealth, choose: Callable[[Layout], Layout]) -> TrignoClient:
    """A client; `choose` is not asked. Raises HricError."""
    section.only("host", "command_port", "data_port", "channels", "rate", "latency")
    base = Settings()
    names = section.content.get("channels", list(base.channels))
    good = isinstance(names, list | tuple) and 1 <= len(names) <= CHANNELS and all(isinstance(name, str) and name for name in names)
    if not good or len(set(names)) != len(names):
        raise ParameterError(f"{section.where}.channels is {names!r}; valid: a list of 1 to {CHANNELS} different names")
    settings = Settings(
        section.text("host", base.host),
        section.whole("command_port", base.command_port, 1, 65535),
        section.whole("data_port", base.data_port, 1, 65535),
        tuple(names),
        section.number("rate", base.rate, 1.0, 1e5),
        section.number("latency", base.latency, 0.0, 1.0),
    )
    return TrignoClient(settings, stream, health)
