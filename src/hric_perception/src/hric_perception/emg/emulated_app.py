"""The node `emulated_emg`: muscles, as an LSL outlet or as a Trigno server."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hric_control.errors import CommandError, ParameterError
from hric_control.node import Node
from hric_control.ros_node import RosNode
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Layout
from hric_perception.chunk_messages import read_chunk
from hric_perception.diagnostics import Reporter
from hric_perception.emg.activation import AMPLITUDE, MUSCLES, PROGRAMS, Activation, read_program
from hric_perception.emg.muscles import Muscles
from hric_perception.emulation import EvenSensor, Faults, read_faults
from hric_perception.emulator import PERIOD, Emulator, Outlet
from hric_perception.lsl import LslOutlet, source_name, use_session
from hric_perception.replayed import read_emg
from hric_perception.section import Section
from hric_perception.sensor import emulated_health, follow_human, section_of, seed_of
from hric_perception.sent import SentCounts
from hric_perception.track import Track
from hric_perception.trigno.protocol import CHANNELS, COMMAND_PORT, EMG_PORT, trigno_name
from hric_perception.trigno.server import TrignoServer
from mocap_natnet.process import run
from mocap_natnet.run_time import RunTime
from mocap_natnet.trial import PROGRAM

NAME = "emulated_emg"
TRANSPORTS = ("lsl", "trigno")


class EmulatedEmgNode:
    """Streams from its construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or a port is taken.
    """

    def __init__(self, node: RosNode) -> None:
        section = section_of(
            node, "transport", "session", "name", "rate", "muscles", "amplitude", "activation", "faults", "ip", "command_port", "data_port", "block"
        )
        names, activation, faults_section = read_names(section), section.section("activation"), section.section("faults")
        self._replayed = read_emg(activation, names) if activation.content.get("program") == PROGRAM else None
        if self._replayed is not None:
            follow_human(node, self._replayed, faults_section)
        faults = read_faults(faults_section, seed_of(node))
        rate, amplitude = section.number("rate", 2000.0, 100.0, 20000.0), section.number("amplitude", AMPLITUDE, 0.0, 1.0)
        signal = self._replayed or Muscles(read_activation(node, activation, names), len(names), rate, amplitude, faults.seed)
        self._sensor = EvenSensor(rate, len(names), signal, faults)
        outlet = make_outlet(section, names, rate, faults)
        self._run_time, self._reporter = RunTime(node), Reporter(node, "stream")
        counts = SentCounts(node, source_of(section), "samples", rate)
        period = section.number("block", PERIOD, 0.001, 1.0)
        self._emulator = Emulator(self._sensor, outlet, self._run_time, period, node.log_error, counts.tell)
        self._emulator.start()
        node.log_info(f"{len(names)} emulated muscles at {rate:g} Hz by {section.text('transport', 'lsl')}")

    def tick(self) -> None:
        """Once a second. Raises HricError in a run that is not paced."""
        self._run_time.tick()
        values = {"samples sent": str(self._sensor.sent), "samples dropped": str(self._sensor.dropped)}
        self._reporter.report(emulated_health(self._run_time.standing, self._replayed, values))

    def close(self) -> None:
        """End."""
        self._emulator.close()
        self._run_time.close()


def read_activation(node: Node, section: Section, names: tuple[str, ...]) -> Activation:
    """What the muscles do: a program, or what a topic tells.

    Args:
        node: hears the topic.
        section: the parameter `activation`.
        names: of the muscles, each of which a message has to name among its channels.

    Raises:
        HricError: a value that cannot be.
    """
    if section.text("program", "bursts", PROGRAMS) != "topic":
        return read_program(section, names)
    section.only("program", "topic")
    track = Track(len(names))

    def hear(message: Any) -> None:
        chunk = read_chunk(message)
        unknown = [name for name in names if name not in chunk.layout.channels]
        if unknown:
            raise CommandError(f"no activation of {', '.join(unknown)}; there is one of {', '.join(chunk.layout.channels)}")
        columns = [chunk.layout.channels.index(name) for name in names]
        for time, row in zip(chunk.times.tolist(), chunk.data[:, columns], strict=True):
            track.add(time, np.nan_to_num(row))

    node.subscribe(section.text("topic", "/hric/human/activation"), SampleChunk, hear, queue_size=100)
    return track.at


def read_names(section: Section) -> tuple[str, ...]:
    """Names of the muscles: a list of them, or how many of the usual ones. Raises ParameterError."""
    names = section.content.get("muscles", len(MUSCLES))
    if isinstance(names, int) and not isinstance(names, bool) and 1 <= names <= len(MUSCLES):
        return MUSCLES[:names]
    good = isinstance(names, list | tuple) and names and all(isinstance(name, str) and name for name in names)
    if not good or len(set(names)) != len(names) or len(names) > 64:
        raise ParameterError(f"{section.where}/muscles is {names!r}; valid: 1 to {len(MUSCLES)}, or a list of up to 64 different names")
    return tuple(names)


def source_of(section: Section) -> str:
    """What the driver calls the stream."""
    if section.text("transport", "lsl", TRANSPORTS) == "lsl":
        return source_name("EMG", section.text("name", NAME))
    return trigno_name(section.text("ip", "127.0.0.1"), section.whole("data_port", EMG_PORT, 0, 65535))


def make_outlet(section: Section, names: tuple[str, ...], rate: float, faults: Faults) -> Outlet:
    """Where the samples go. Raises HricError."""
    if section.text("transport", "lsl", TRANSPORTS) == "lsl":
        use_session(section.text("session"))
        units = ("V",) * len(names) + ("s",) * faults.time_code
        channels = names + ("time",) * faults.time_code
        return LslOutlet(Layout(section.text("name", NAME), channels, units, rate), "EMG", section.text("name", NAME))
    if len(names) + faults.time_code > CHANNELS:
        raise ParameterError(f"{section.where}/muscles are {len(names)}; valid for a Trigno: {CHANNELS}, the time code counts as one")
    command, data = section.whole("command_port", COMMAND_PORT, 0, 65535), section.whole("data_port", EMG_PORT, 0, 65535)
    server = TrignoServer(rate, section.text("ip", "127.0.0.1"), command, data, faults.time_code)
    server.start()
    return server


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""

    def make(node: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        emulated = EmulatedEmgNode(node)
        return emulated.tick, emulated.close

    return run(NAME, text, make)
