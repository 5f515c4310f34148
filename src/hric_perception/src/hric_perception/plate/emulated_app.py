"""The node `emulated_plate`: a force plate, as an LSL outlet or within the frames of an emulated Motive."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from gazebo_msgs.msg import ContactsState
from hric_control.geometry import Pose
from hric_control.parameters import Settings, choice, mapping, number, section, text
from hric_control.ros import RosNode, run
from hric_perception.chunk import Layout
from hric_perception.emulation import BLOCK, SEED, EvenSensor, Faults, faults_of
from hric_perception.lsl import LslOutlet, source_name, use_session
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
from hric_perception.plate.natnet import PlateMotive, PlateStream
from hric_perception.replayed import RecordedLoad, follow_human
from hric_perception.sensor import EmulatedNode
from hric_perception.simulated import PERSON, KnownTime, follow_grips, follow_joints, person_of

NAME = "emulated_plate"
TRANSPORTS = ("lsl", "natnet")


@dataclass(frozen=True)
class EmulatedPlateSettings(Settings):
    """Parameters of the node."""

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


class EmulatedPlateNode(EmulatedNode):
    """Streams from its construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or a port is taken.
    """

    def __init__(self, node: RosNode) -> None:
        settings = EmulatedPlateSettings.read(node)
        program = settings.load
        replayed = program.replayed() if isinstance(program, RecordedLoad) else None
        super().__init__(node, replayed)
        load: Load
        if replayed is not None:
            delay, load = follow_human(node, replayed), replayed.at
        elif isinstance(program, Body):
            delay, load = 0.0, self._followed(settings)
        else:
            delay = CONTACTS_DELAY if isinstance(program, Contacts) else 0.0
            load = self._made_load(node, program, settings.pose.pose)
        faults = faults_of(settings.faults, node.resolve("faults"), settings.seed, delay)
        if settings.transport == "lsl":
            self._send_lsl(settings, load, faults)
        else:
            stream = settings.natnet
            if stream.centre is None:
                stream = replace(stream, centre=settings.pose.xyz)
            self._source = PlateMotive(stream, settings.rate, load, faults, self.clock)
        node.log_info(f"an emulated force plate at {settings.rate:g} Hz by {settings.transport}")

    def _send_lsl(self, settings: EmulatedPlateSettings, load: Load, faults: Faults) -> None:
        use_session(settings.session)
        name, rate, code = settings.name, settings.rate, faults.time_code
        layout = Layout(name, CHANNELS + ("time",) * code, UNITS + ("s",) * code, rate)
        sensor = EvenSensor(rate, len(CHANNELS), lambda first, times: load(times), faults)
        self._send(sensor, LslOutlet(layout, "Force", name), source_name("Force", name), settings.block)

    def _followed(self, settings: EmulatedPlateSettings) -> Load:
        """What the human in the robot's plant presses with. Its samples are sent when they are known."""
        load = FloorLoad(person_of(settings.person, settings.prefix), settings.pose.pose)
        follow_joints(self._node, load.add)
        follow_grips(self._node, load.hold)
        # Over NatNet a frame goes out its latency after its samples.
        ahead = settings.natnet.latency if settings.transport == "natnet" else 0.0
        self.clock = KnownTime(self.robot_time, lambda: load.known, ahead)
        return load

    @staticmethod
    def _made_load(node: RosNode, program: Settings, pose: Pose) -> Load:
        if not isinstance(program, Contacts):
            assert isinstance(program, Push | Constant)
            return program.load()
        load = ContactLoad(program.body, pose)

        def add(message: Any) -> None:
            load.add(
                message.header.stamp.to_sec(),
                [(one.collision1_name, one.collision2_name, list(_points(one))) for one in message.states],
            )

        node.subscribe(node.beside(program.topic), ContactsState, add, queue_size=100)
        return load


def _points(state: Any) -> Any:
    """(point, force) of each contact point."""
    for position, wrench in zip(state.contact_positions, state.wrenches, strict=True):
        yield (position.x, position.y, position.z), (wrench.force.x, wrench.force.y, wrench.force.z)


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""
    return run(NAME, text, EmulatedPlateNode)
