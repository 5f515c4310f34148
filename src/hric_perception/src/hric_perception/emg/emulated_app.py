"""The node `emulated_emg`: muscles, as an LSL outlet or as a Trigno server."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_control.errors import CommandError
from hric_control.node import Node
from hric_control.parameters import Settings, choice, mapping, number, refused, text, whole
from hric_control.ros import RosNode, run
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Layout, read_chunk
from hric_perception.emg.muscles import AMPLITUDE, PROGRAM, Activation, Muscles, Program, TopicActivation, muscle_names
from hric_perception.emulation import EvenSensor, Faults, Outlet
from hric_perception.lsl import LslOutlet, source_name, use_session
from hric_perception.replayed import RecordedEmg, Track
from hric_perception.sensor import BLOCK, SEED, EmulatedNode, faults_of, follow_human
from hric_perception.trigno.protocol import CHANNELS, COMMAND_PORT, EMG_PORT, trigno_name
from hric_perception.trigno.server import TrignoServer

NAME = "emulated_emg"
TRANSPORTS = ("lsl", "trigno")


@dataclass(frozen=True)
class EmulatedEmgSettings(Settings):
    """Parameters of the node."""

    transport: str = choice(*TRANSPORTS)
    session: str = text("", figures=True, text="LSL session, see below")
    name: str = text(NAME, figures=True, text="of the LSL stream")
    rate: float = number(2000.0, minimum=100.0, maximum=20000.0, unit="Hz")
    muscles: tuple[str, ...] = muscle_names("how many of the usual ones, or names")
    amplitude: float = number(AMPLITUDE, minimum=0.0, maximum=1.0, unit="V", text="root mean square at full activation")
    activation: Settings = PROGRAM
    faults: Mapping[str, Any] = mapping(default={}, text="see below")
    seed: int = SEED
    ip: str = text("127.0.0.1", text="address of the Trigno server")
    command_port: int = whole(COMMAND_PORT, minimum=0, maximum=65535, text="TCP")
    data_port: int = whole(EMG_PORT, minimum=0, maximum=65535, text="TCP")
    block: float = BLOCK

    @property
    def source(self) -> str:
        """What the driver calls the stream."""
        return source_name("EMG", self.name) if self.transport == "lsl" else trigno_name(self.ip, self.data_port)


class EmulatedEmgNode(EmulatedNode):
    """Streams from its construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or a port is taken.
    """

    def __init__(self, node: RosNode) -> None:
        settings = EmulatedEmgSettings.read(node)
        program, count, rate = settings.activation, len(settings.muscles), settings.rate
        replayed = program.replayed(settings.muscles) if isinstance(program, RecordedEmg) else None
        delay = follow_human(node, replayed) if replayed is not None else 0.0
        faults = faults_of(settings.faults, node.resolve("faults"), settings.seed, delay)
        signal = replayed or Muscles(
            activation_of(node, program, settings.muscles), count, rate, settings.amplitude, faults.seed
        )
        sensor, outlet = EvenSensor(rate, count, signal, faults), make_outlet(settings, faults)
        super().__init__(node, replayed)
        self._send(sensor, outlet, settings.source, settings.block)
        node.log_info(f"{count} emulated muscles at {rate:g} Hz by {settings.transport}")


def activation_of(node: Node, program: Settings, names: tuple[str, ...]) -> Activation:
    """What the muscles do: a program, or the values of a topic.

    Args:
        node: subscribes to the topic.
        program: the parameter `activation`.
        names: of the muscles, each of which a message has to name among its channels.

    Raises:
        HricError: a value that cannot be.
    """
    if not isinstance(program, TopicActivation):
        assert isinstance(program, Program)
        return program.activation(len(names))
    track = Track(len(names))

    def add(message: Any) -> None:
        chunk = read_chunk(message)
        unknown = [name for name in names if name not in chunk.layout.channels]
        if unknown:
            raise CommandError(
                f"no activation of {', '.join(unknown)}; there is one of {', '.join(chunk.layout.channels)}"
            )
        columns = [chunk.layout.channels.index(name) for name in names]
        for time, row in zip(chunk.times.tolist(), chunk.data[:, columns], strict=True):
            track.add(time, np.nan_to_num(row))

    node.subscribe(node.beside(program.topic), SampleChunk, add, queue_size=100)
    return track.at


def make_outlet(settings: EmulatedEmgSettings, faults: Faults) -> Outlet:
    """Where the samples go. Raises HricError."""
    names, code = settings.muscles, faults.time_code
    if settings.transport == "lsl":
        use_session(settings.session)
        layout = Layout(settings.name, names + ("time",) * code, ("V",) * len(names) + ("s",) * code, settings.rate)
        return LslOutlet(layout, "EMG", settings.name)
    if len(names) + code > CHANNELS:
        raise refused(f"{settings.prefix}muscles", list(names), f"for a Trigno {CHANNELS}, the time code counts as one")
    server = TrignoServer(settings.rate, settings.ip, settings.command_port, settings.data_port, code)
    server.start()
    return server


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""
    return run(NAME, text, EmulatedEmgNode)
