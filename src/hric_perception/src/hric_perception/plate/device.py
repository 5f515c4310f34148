"""Emulated force plate on any node: its parameters, its load, and the time up to which that is known."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gazebo_msgs.msg import ContactsState
from hric_core.geometry import Pose
from hric_core.node import Node
from hric_core.parameters import Settings, choice, mapping, number, section, text
from hric_perception.chunk import Layout
from hric_perception.emulation import BLOCK, SEED, EvenSensor, faults_of
from hric_perception.lsl import source_name
from hric_perception.plate.geometry import CHANNELS, UNITS, PlatePose
from hric_perception.plate.loads import (
    CONTACTS_DELAY,
    PROGRAM,
    Body,
    Constant,
    ContactLoad,
    Contacts,
    FloorLoad,
    Load,
    Push,
)
from hric_perception.plate.natnet import PlateStream
from hric_perception.replayed import RecordedLoad, Replayed, follow_human
from hric_perception.simulated import PERSON, always, follow_grips, follow_joints, person_of

NAME = "emulated_plate"
TRANSPORTS = ("lsl", "natnet")


@dataclass(frozen=True)
class EmulatedPlateSettings(Settings):
    """Parameters of the device."""

    transport: str = choice(*TRANSPORTS)
    session: str = text("", figures=True, text="LSL session, see below")
    name: str = text(NAME, figures=True, text="of the LSL stream")
    rate: float = number(1000.0, minimum=10.0, maximum=20000.0, unit="Hz")
    load: Settings = PROGRAM
    person: Any = PERSON
    pose: PlatePose = section(PlatePose)
    natnet: PlateStream = section(PlateStream)
    faults: Mapping[str, Any] = mapping(default={}, text="see below")
    seed: int = SEED
    block: float = BLOCK

    @property
    def source(self) -> str:
        """Name of the LSL stream in the driver's messages."""
        return source_name("Force", self.name)


class EmulatedPlate:
    """Emulated force plate, without the sender of its samples.

    Args:
        node: private node, which may subscribe to the load.
        settings: parameters of the plate.

    Attributes:
        load: load on the plate.
        faults: faults of the samples.
        replayed: trial that it replays, if any.
        known: time up to which the load is known [s].

    Raises:
        HricError: a parameter is not valid.
    """

    def __init__(self, node: Node, settings: EmulatedPlateSettings) -> None:
        program, delay = settings.load, 0.0
        self.replayed: Replayed | None = program.replayed() if isinstance(program, RecordedLoad) else None
        self.known: Callable[[], float] = always
        self.load: Load
        if self.replayed is not None:
            delay, self.load = follow_human(node, self.replayed), self.replayed.at
        elif isinstance(program, Body):
            self.load = floor = FloorLoad(person_of(settings.person, settings.prefix), settings.pose.pose)
            follow_joints(node, floor.add)
            follow_grips(node, floor.hold)
            self.known = lambda: floor.known
        elif isinstance(program, Contacts):
            delay, self.load = CONTACTS_DELAY, _followed(node, program, settings.pose.pose)
        else:
            assert isinstance(program, Push | Constant)
            self.load = program.load()
        self.faults = faults_of(settings.faults, node.resolve("faults"), settings.seed, delay)
        self._settings = settings

    def sensor(self) -> EvenSensor:
        """Return the sampled sensor; over NatNet the emulated Motive samples instead."""
        load = self.load
        return EvenSensor(self._settings.rate, len(CHANNELS), lambda first, times: load(times), self.faults)

    @property
    def layout(self) -> Layout:
        """Layout of the samples as they leave the device; the source is the stream's name."""
        code = self.faults.time_code
        name, rate = self._settings.name, self._settings.rate
        return Layout(name, CHANNELS + ("time",) * code, UNITS + ("s",) * code, rate)


def _followed(node: Node, program: Contacts, pose: Pose) -> ContactLoad:
    """Return the contact load on a body of the simulation."""
    load = ContactLoad(program.body, pose)

    def add(message: Any) -> None:
        load.add(
            message.header.stamp.to_sec(),
            [(one.collision1_name, one.collision2_name, list(_points(one))) for one in message.states],
        )

    node.subscribe(node.beside(program.topic), ContactsState, add, queue_size=100)
    return load


def _points(state: Any) -> Any:
    """Return (point, force) of each contact point."""
    for position, wrench in zip(state.contact_positions, state.wrenches, strict=True):
        yield (position.x, position.y, position.z), (wrench.force.x, wrench.force.y, wrench.force.z)
