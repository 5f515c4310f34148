"""An LSL reader from the parameters of a node."""

from __future__ import annotations

from collections.abc import Callable

from hric_perception.chunk import Layout
from hric_perception.health import StreamHealth
from hric_perception.lsl.inlet import LslReader, Wanted
from hric_perception.lsl.session import use_session
from hric_perception.section import Section
from hric_perception.stream import SampleStream


def lsl_driver(kind: str) -> Callable[[Section, SampleStream, StreamHealth, Callable[[Layout], Layout]], LslReader]:
    """Makes readers of streams of a type, unless the parameters say another one."""

    def make(section: Section, stream: SampleStream, health: StreamHealth, choose: Callable[[Layout], Layout]) -> LslReader:
        section.only("type", "name", "source_id", "session")
        use_session(section.text("session"))
        return LslReader(Wanted(section.text("type", kind), section.text("name"), section.text("source_id")), stream, health, choose)

    return make
