"""The node `emulated_plate`: a force plate, as an LSL outlet or within the frames of an emulated Motive."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from gazebo_msgs.msg import ContactsState
from hric_control.errors import ParameterError
from hric_control.ros_node import RosNode
from hric_perception import replayed
from hric_perception.chunk import Layout
from hric_perception.diagnostics import Reporter
from hric_perception.emulation import EvenSensor, Faults, read_faults
from hric_perception.emulator import PERIOD, Emulator
from hric_perception.lsl import LslOutlet, source_name, use_session
from hric_perception.plate.geometry import CHANNELS, UNITS, read_place
from hric_perception.plate.loads import CONTACTS_DELAY, PROGRAMS, ContactLoad, Load, read_load
from hric_perception.plate.motive import PlateMotive
from hric_perception.section import Section
from hric_perception.sensor import emulated_health, follow_human, section_of, seed_of
from hric_perception.sent import SentCounts
from mocap_natnet.process import run
from mocap_natnet.run_time import RunTime
from mocap_natnet.trial import PROGRAM

NAME = "emulated_plate"
TRANSPORTS = ("lsl", "natnet")


class _Source(Protocol):
    def close(self) -> None:
        """End."""


class EmulatedPlateNode:
    """Streams from its construction on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or a port is taken.
    """

    def __init__(self, node: RosNode) -> None:
        section = section_of(node, "transport", "session", "name", "rate", "load", "faults", "pose", "natnet", "block")
        faults_section = section.section("faults")
        load_section = section.section("load")
        if load_section.content.get("program") == "contacts" and "delay" not in faults_section.content:
            faults_section.content["delay"] = CONTACTS_DELAY
        self._replayed = replayed.read_load(load_section) if load_section.content.get("program") == PROGRAM else None
        if self._replayed is not None:
            follow_human(node, self._replayed, faults_section)
        faults = read_faults(faults_section, seed_of(node))
        self._load = self._replayed.at if self._replayed is not None else self._read_load(node, load_section, section.section("pose"))
        self._run_time, self._reporter = RunTime(node), Reporter(node, "stream")
        transport, rate = section.text("transport", "lsl", TRANSPORTS), section.number("rate", 1000.0, 10.0, 20000.0)
        self._sensor: EvenSensor | None = None
        self._source = self._over_lsl(node, section, rate, faults) if transport == "lsl" else self._over_natnet(section, rate, faults)
        node.log_info(f"an emulated force plate at {rate:g} Hz by {transport}")

    def tick(self) -> None:
        """Once a second. Raises HricError in a run that is not paced."""
        self._run_time.tick()
        sensor = self._sensor
        values = {} if sensor is None else {"samples sent": str(sensor.sent), "samples dropped": str(sensor.dropped)}
        self._reporter.report(emulated_health(self._run_time.standing, self._replayed, values))

    def close(self) -> None:
        """End."""
        self._source.close()
        self._run_time.close()

    def _over_lsl(self, node: RosNode, section: Section, rate: float, faults: Faults) -> _Source:
        use_session(section.text("session"))
        name, load = section.text("name", NAME), self._load
        units, channels = UNITS + ("s",) * faults.time_code, CHANNELS + ("time",) * faults.time_code
        self._sensor = EvenSensor(rate, len(CHANNELS), lambda first, times: load(times), faults)
        outlet, counts = LslOutlet(Layout(name, channels, units, rate), "Force", name), SentCounts(node, source_name("Force", name), "samples", rate)
        emulator = Emulator(self._sensor, outlet, self._run_time, section.number("block", PERIOD, 0.001, 1.0), node.log_error, counts.tell)
        emulator.start()
        return emulator

    def _over_natnet(self, section: Section, rate: float, faults: Faults) -> _Source:
        stream = section.section("natnet")
        stream.content.setdefault("centre", list(read_place(section.section("pose"))[1].position))
        return PlateMotive(stream, rate, self._load, faults, self._run_time)

    @staticmethod
    def _read_load(node: RosNode, section: Section, pose: Section) -> Load:
        if section.text("program", "push", PROGRAMS) != "contacts":
            return read_load(section)
        section.only("program", "body", "topic")
        load = ContactLoad(section.text("body", "plate"), read_place(pose)[1])

        def hear(message: Any) -> None:
            load.add(message.header.stamp.to_sec(), [(one.collision1_name, one.collision2_name, list(_points(one))) for one in message.states])

        topic = section.text("topic", "/sim/contacts")
        if not topic:
            raise ParameterError(f"{section.where}.topic is empty; valid: a topic of gazebo_msgs/ContactsState")
        node.subscribe(topic, ContactsState, hear, queue_size=100)
        return load


def _points(state: Any) -> Any:
    """(point, force) of each contact point."""
    for position, wrench in zip(state.contact_positions, state.wrenches, strict=True):
        yield (position.x, position.y, position.z), (wrench.force.x, wrench.force.y, wrench.force.z)


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""

    def make(node: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        emulated = EmulatedPlateNode(node)
        return emulated.tick, emulated.close

    return run(NAME, text, make)
