"""Emulated force plate: its parameters, its load, and the time up to which the load is known."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

from gazebo_msgs.msg import ContactsState
from hric_core.geometry import Pose
from hric_core.node import Node
from hric_core.parameters import Settings, choice, number, section, text
from hric_core.robot_time.stream_time import Clock
from hric_perception.emulation import faults_of
from hric_perception.plate.geometry import CHANNELS, UNITS, PlatePose
from hric_perception.plate.loads import (
    CONTACTS_DELAY,
    PROGRAM,
    ConstantLoad,
    ContactLoad,
    Contacts,
    FloorLoad,
    Load,
    Push,
    StandingBody,
)
from hric_perception.plate.natnet import PlateMotive, PlateStream
from hric_perception.replayed import RecordedLoad, follow_human
from hric_perception.sampled import Closable, Device, DeviceSettings
from hric_perception.simulated import PERSON, always, follow_grips, follow_joints, person_of


@dataclass(frozen=True)
class EmulatedPlateSettings(DeviceSettings):
    """Parameters of the node `emulated_plate`, an emulated force plate."""

    kind: ClassVar[str] = "Force"
    transport: str = choice("lsl", "natnet")
    name: str = text("emulated_plate", figures=True, text="name of the LSL stream")
    rate: float = number(1000.0, minimum=10.0, maximum=20000.0, unit="Hz")
    load: Settings = PROGRAM
    person: Any = PERSON
    pose: PlatePose = section(PlatePose)
    natnet: PlateStream = section(PlateStream)

    @property
    def ahead(self) -> float:
        """Lead of the device's clock over its known load [s]: a NatNet frame is sent one latency after its samples."""
        return self.natnet.latency if self.transport == "natnet" else 0.0

    @property
    def title(self) -> str:
        """Name of the device in the node's log."""
        return "an emulated force plate"

    def device(self, node: Node) -> Device:
        """Create the emulated plate; subscribe to topics if its load comes from them."""
        program, delay = self.load, 0.0
        replayed = program.replayed() if isinstance(program, RecordedLoad) else None
        known: Callable[[], float] = always
        load: Load
        if replayed is not None:
            delay, load = follow_human(node, replayed), replayed.at
        elif isinstance(program, StandingBody):
            load = floor = FloorLoad(person_of(self.person, self.prefix), self.pose.pose)
            follow_joints(node, floor.add)
            follow_grips(node, floor.hold)
            known = partial(getattr, floor, "known")
        elif isinstance(program, Contacts):
            delay, load = CONTACTS_DELAY, _followed(node, program, self.pose.pose)
        else:
            assert isinstance(program, Push | ConstantLoad)
            load = program.load()
        faults = faults_of(self.faults, node.resolve("faults"), self.seed, delay)
        return Device(self, CHANNELS, UNITS, lambda first, times: load(times), faults, known, replayed)

    def served(self, device: Device, clock: Clock, on_reached: Callable[[float | None], None]) -> Closable | None:
        """Start and return the emulated Motive that streams the plate over NatNet; None with LSL."""
        if self.transport == "lsl":
            return None
        stream = replace(self.natnet, centre=self.natnet.centre or self.pose.xyz)
        return PlateMotive(stream, self.rate, lambda times: device.signal(0, times), device.faults, clock, on_reached)


def _followed(node: Node, program: Contacts, pose: Pose) -> ContactLoad:
    """Subscribe to contacts of the simulation, and return their load on a simulated plate."""
    load = ContactLoad(program.body, pose)

    def add(message: Any) -> None:
        load.add(
            message.header.stamp.to_sec(),
            [(state.collision1_name, state.collision2_name, list(_points(state))) for state in message.states],
        )

    node.subscribe(node.beside(program.topic), ContactsState, add, queue_size=100)
    return load


def _points(state: Any) -> Any:
    """Yield (point [m], force [N]) of each contact point of a gazebo_msgs/ContactState."""
    for position, wrench in zip(state.contact_positions, state.wrenches, strict=True):
        yield (position.x, position.y, position.z), (wrench.force.x, wrench.force.y, wrench.force.z)
