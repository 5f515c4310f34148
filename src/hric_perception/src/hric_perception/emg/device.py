"""Emulated EMG device on any node: its parameters, muscle activation, and due samples."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from hric_core.node import Node
from hric_core.parameters import Settings, choice, mapping, number, refused, text, whole
from hric_msgs.msg import MuscleActivation
from hric_perception.chunk import Layout
from hric_perception.emg.muscles import (
    AMPLITUDE,
    PROGRAM,
    Activation,
    BodyActivation,
    Muscles,
    Program,
    TopicActivation,
    muscle_names,
)
from hric_perception.emulation import BLOCK, SEED, EvenSensor, Signal, faults_of
from hric_perception.lsl import source_name
from hric_perception.replayed import RecordedEmg, Replayed, follow_human
from hric_perception.simulated import always
from hric_perception.trigno.protocol import CHANNELS, COMMAND_PORT, EMG_PORT, trigno_name

NAME = "emulated_emg"
TRANSPORTS = ("lsl", "trigno")


@dataclass(frozen=True)
class EmulatedEmgSettings(Settings):
    """Parameters of the device."""

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
        """Name of the stream in the driver's messages."""
        return source_name("EMG", self.name) if self.transport == "lsl" else trigno_name(self.ip, self.data_port)


class EmulatedEmg:
    """Emulated EMG device, without the sender of its samples.

    Args:
        node: private node, which may subscribe to the muscle activation.
        settings: parameters of the device.

    Attributes:
        sensor: sampled sensor.
        layout: layout of the samples as they leave the device; the source is the stream's name.
        replayed: trial that it replays, if any.
        known: time up to which the activation is known [s].

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: Node, settings: EmulatedEmgSettings) -> None:
        names, rate, program = settings.muscles, settings.rate, settings.activation
        self.replayed: Replayed | None = program.replayed(names) if isinstance(program, RecordedEmg) else None
        delay = 0.0 if self.replayed is None else follow_human(node, self.replayed)
        faults = faults_of(settings.faults, node.resolve("faults"), settings.seed, delay)
        if settings.transport == "trigno" and len(names) + faults.time_code > CHANNELS:
            valid = f"for a Trigno {CHANNELS}, the time code counts as one"
            raise refused(f"{settings.prefix}muscles", list(names), valid)
        signal: Signal
        if self.replayed is not None:
            self.known, signal = always, self.replayed
        else:
            activation, self.known = activation_of(node, program, names)
            signal = Muscles(activation, len(names), rate, settings.amplitude, faults.seed)
        self.sensor, code = EvenSensor(rate, len(names), signal, faults), faults.time_code
        self.layout = Layout(settings.name, names + ("time",) * code, ("V",) * len(names) + ("s",) * code, rate)


def activation_of(node: Node, program: Settings, channels: tuple[str, ...]) -> tuple[Activation, Callable[[], float]]:
    """Return the muscle activation of a program or a topic, and the time up to which it is known [s].

    Args:
        node: node that subscribes to the topic.
        program: the parameter `activation`.
        channels: names of the channels.

    Raises:
        HricError: an invalid value.
    """
    if not isinstance(program, TopicActivation):
        assert isinstance(program, Program)
        return program.activation(len(channels)), always
    body = BodyActivation(channels, program.side)

    def add(message: Any) -> None:
        body.add(message.header.stamp.to_sec(), message.name, message.activation)

    node.subscribe(node.beside(program.topic), MuscleActivation, add, queue_size=0)
    return body.at, lambda: body.known
