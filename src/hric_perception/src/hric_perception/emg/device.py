"""Emulated EMG device: its parameters, muscle activation, and samples."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from hric_core.node import Node
from hric_core.parameters import Settings, choice, number, refused, text, whole
from hric_msgs.msg import MuscleActivation
from hric_perception.emg.muscles import (
    AMPLITUDE,
    PROGRAM,
    Activation,
    ActivationProgram,
    BodyActivation,
    EmulatedMuscles,
    TopicActivation,
    muscle_names,
)
from hric_perception.emulation import Outlet, faults_of
from hric_perception.replayed import RecordedEmg, follow_human
from hric_perception.sampled import Device, DeviceSettings
from hric_perception.simulated import always
from hric_perception.trigno.protocol import CHANNELS, COMMAND_PORT, EMG_PORT, trigno_name
from hric_perception.trigno.server import TrignoServer


@dataclass(frozen=True)
class EmulatedEmgSettings(DeviceSettings):
    """Parameters of the node `emulated_emg`, an emulated EMG device."""

    kind: ClassVar[str] = "EMG"
    transport: str = choice("lsl", "trigno")
    name: str = text("emulated_emg", figures=True, text="name of the LSL stream")
    rate: float = number(2000.0, minimum=100.0, maximum=20000.0, unit="Hz")
    muscles: tuple[str, ...] = muscle_names("number of default muscles, or names of muscles")
    amplitude: float = number(AMPLITUDE, minimum=0.0, maximum=1.0, unit="V", text="root mean square at full activation")
    activation: Settings = PROGRAM
    ip: str = text("127.0.0.1", text="address of the Trigno server")
    command_port: int = whole(COMMAND_PORT, minimum=0, maximum=65535, text="TCP port of commands; 0: any free one")
    data_port: int = whole(EMG_PORT, minimum=0, maximum=65535, text="TCP port of EMG data; 0: any free one")

    @property
    def source(self) -> str:
        """Name of the device's stream, LSL or Trigno, as the EMG driver writes it into its messages."""
        return super().source if self.transport == "lsl" else trigno_name(self.ip, self.data_port)

    @property
    def title(self) -> str:
        """Name of the device in the node's log."""
        return f"{len(self.muscles)} emulated muscles"

    def device(self, node: Node) -> Device:
        """Create the emulated muscles; subscribe to their activation if the program takes it from a topic."""
        names, program = self.muscles, self.activation
        replayed = program.replayed(names) if isinstance(program, RecordedEmg) else None
        delay = 0.0 if replayed is None else follow_human(node, replayed)
        faults = faults_of(self.faults, node.resolve("faults"), self.seed, delay)
        if self.transport == "trigno" and len(names) + faults.time_code > CHANNELS:
            valid = f"up to {CHANNELS} channels of a Trigno server, time code included"
            raise refused(f"{self.prefix}muscles", list(names), valid)
        units = ("V",) * len(names)
        if replayed is not None:
            return Device(self, names, units, replayed, faults, always, replayed)
        activation, known = activation_of(node, program, names)
        signal = EmulatedMuscles(activation, len(names), self.rate, self.amplitude, faults.seed)
        return Device(self, names, units, signal, faults, known, None)

    def outlet(self, device: Device) -> Outlet:
        """Create the sender of the samples: an emulated Trigno server or an LSL outlet."""
        if self.transport == "lsl":
            return super().outlet(device)
        server = TrignoServer(self.rate, self.ip, self.command_port, self.data_port, device.faults.time_code)
        server.start()
        return server


def activation_of(node: Node, program: Settings, channels: tuple[str, ...]) -> tuple[Activation, Callable[[], float]]:
    """Return the activation as a function of robot time, and a function for the time up to which it is known [s].

    Args:
        node: node that subscribes to the topic.
        program: value of the parameter `activation`: an activation program, or a topic.
        channels: names of the EMG channels.

    Raises:
        HricError: a value of the program is not valid.
    """
    if not isinstance(program, TopicActivation):
        assert isinstance(program, ActivationProgram)
        return program.activation(len(channels)), always
    body = BodyActivation(channels, program.side)

    def add(message: Any) -> None:
        body.add(message.header.stamp.to_sec(), message.name, message.activation)

    node.subscribe(node.beside(program.topic), MuscleActivation, add, queue_size=0)
    return body.at, lambda: body.known
