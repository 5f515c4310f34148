"""Sections `mocap`, `emg`, `force_plate`, `sync`, `human`, `person`, `supervisor` of an experiment file.

Each is declared once: files are read by it, parameters of nodes and sources of the synchroniser follow from it, and
INTERFACE.md prints it. Mappings for a node are checked by the declarations of that node's package and passed on
unchanged.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar
from urllib.parse import urlparse

import numpy as np

from hric_assessment.supervisor.settings import SupervisorSettings
from hric_core.parameters import (
    Parameter,
    Settings,
    choice,
    flag,
    listing,
    mapping,
    number,
    numbers,
    refused,
    section,
    text,
)
from hric_core.trial.c3d import located
from hric_human.participant.settings import HumanSettings
from hric_perception.emg.envelope import Settings as EnvelopeSettings
from hric_perception.emg.muscles import AMPLITUDE, Program, TopicActivation, muscle_names
from hric_perception.emg.muscles import PROGRAM as ACTIVATION
from hric_perception.emulation import Faults
from hric_perception.lsl import LslSettings
from hric_perception.person.settings import PersonSettings
from hric_perception.plate import loads
from hric_perception.plate.geometry import CHANNELS, PLATE_ID, PLATE_SIZE, PlatePose
from hric_perception.replayed import RecordedEmg, RecordedLoad
from hric_perception.simulated import measures_him
from hric_perception.sync.messages import TOPIC, rate_topic
from hric_perception.trigno.client import Settings as TrignoSettings
from hric_run.definition.parameters import EMULATED_HUMAN, MOCAP_CLIENT
from mocap_natnet.client import Settings as ClientSettings
from mocap_natnet.node.parameters import Publishing

if TYPE_CHECKING:
    from hric_perception.human import CapturedHuman

EMULATED, REAL, NONE = "emulated", "real", "none"
NATNET_PORTS = {"command_port": 1512, "data_port": 1513}
"""Ports of an emulated plate's Motive, other than those of the motion capture (project default, unconfirmed)."""
BLOCK = 0.02
"""Longest time between packets of an emulated or real device [s of wall time] (project default, unconfirmed)."""
FRAMES = "hric/perception/mocap"
MOCAP_GAP, CHUNK_GAP = 0.05, 0.01
"""Largest gap that is interpolated [s], below that of an occlusion or lost samples (project default, unconfirmed)."""


def session() -> str:
    """Return the LSL session of emulated devices: several bring-ups on one machine have masters on different ports."""
    return f"hric_{urlparse(os.environ.get('ROS_MASTER_URI', '')).port or 11311}"


def for_node(declaration: Parameter, said: str) -> Any:
    """Return a parameter for a node's mapping, checked by its declaration and passed on unchanged; default: None."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> dict[str, Any]:
        declaration.checked(value, where, joints)
        return dict(value)

    return Parameter("mapping", declaration.accepts, convert, None, text=said, shape=declaration.shape)


@dataclass(frozen=True)
class MocapSection(Settings):
    """The section `mocap`."""

    body: str = text(
        "", figures=True, text="whose position is `/mocap/marker`, and is compared with the end effector's; empty: hand"
    )
    stream: Mapping[str, Any] = mapping(default={}, text="how the emulated Motive streams: hric_perception")
    human: Mapping[str, Any] = mapping(default={}, text="how the emulated human moves: hric_perception")
    base_from_mocap: Mapping[str, Any] | None = mapping(
        default=None,
        text="`xyz` [m] and `xyzw`: pose of the mocap frame, z up, in the robot's base; none: not known, positions "
        "stay in the mocap frame",
    )

    def check(self, where: str) -> None:
        """Refuse values that the emulated human or Motive does not accept, and a body that is not streamed."""
        seen = self.build(0, {"person": {}} if self.measures_him else {})  # names are the same for any person
        bodies = [body.name for body in seen.motive.scene.bodies]
        object.__setattr__(self, "body", self.body or seen.name)
        if self.body not in bodies:
            raise refused(f"{where}body", self.body, ", ".join(bodies))

    @property
    def measures_him(self) -> bool:
        """True if it tracks the human in the plant."""
        return measures_him(self.human)

    def build(self, seed: int, person: Mapping[str, Any]) -> "CapturedHuman":
        """Return the emulated human and the Motive that tracks them.

        Args:
            seed: seed of all random numbers.
            person: result of `parameters.person`, needed if it tracks the human in the plant.

        Raises:
            HricError: a value is not valid.
        """
        # Imported only for runs with a human.
        from hric_perception.human import see

        return see(self.human, self.stream, self.base_from_mocap, seed, self.prefix, **person)

    def nodes(self, arm_id: str, seed: int, person: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
        """Return private parameters of the client and the emulated human, by node name; person: see `build`."""
        frame = {"base_frame": f"{arm_id}_link0"}
        base = {} if self.base_from_mocap is None else {"base_from_mocap": dict(self.base_from_mocap)}
        ports = {key: self.stream[key] for key in ("command_port", "data_port") if key in self.stream}
        client = {"body": self.body, "up_axis": self.stream.get("up_axis", "y"), **ports, **base}
        human = {"human": located(self.human, Path.cwd()), "stream": dict(self.stream), **base, **frame, "seed": seed}
        human |= person if self.measures_him else {}
        return {MOCAP_CLIENT: client | (frame if base else {}), EMULATED_HUMAN: human}

    @property
    def source(self) -> dict[str, Any]:
        """Source of the poses for the plan of the synchroniser."""
        signals = [f"rigid_bodies[{self.body}].pose"]
        return {"topic": FRAMES, "type": "hric_msgs/MocapData", "max_gap": MOCAP_GAP, "signals": signals}


@dataclass(frozen=True)
class SensorSection(Settings):
    """Common part of the sections of evenly sampling sensors."""

    name: ClassVar[str]
    """Name of the section and of the driver's node."""
    emulated_name: ClassVar[str]
    """Name of the emulated device's node and of its LSL stream."""
    driver_keys: ClassVar[tuple[str, ...]]
    """Keys that the driver's node reads itself."""
    described_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that only exported files need."""
    transport: str
    channels: tuple[str, ...]
    rate: float
    device: str = choice(EMULATED, REAL, NONE, text="real: without the emulated device; none: without the sensor")
    chunk: float = number(
        0.05,
        minimum=0.001,
        maximum=1.0,
        unit="s",
        text="duration of a message; a few large ones cost less than many small ones (project default, unconfirmed)",
    )
    lsl: Mapping[str, Any] | None = for_node(section(LslSettings), "which stream: hric_perception")
    emulated: Mapping[str, Any] = mapping(default={}, text="what the emulated device measures, and its `faults`")

    @property
    def used(self) -> bool:
        """True if the sensor is part of this run."""
        return self.device != NONE

    @property
    def time_code(self) -> bool:
        """True if a channel has the robot time of each sample."""
        return self.device == EMULATED and bool((self.emulated.get("faults") or {}).get("time_code", False))

    @property
    def wire(self) -> str:
        """Text on the part of the sensor that needs a wire; "": it needs none."""
        return f"a real {self.name}" if self.device == REAL else ""

    def record(self) -> dict[str, Any]:
        """Return the values for run.yaml, with groups for the driver's node and for exported files."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        groups = {"driver": self.driver_keys, "described": self.described_keys}
        return {
            group: {key: value for key in keys if (value := values.pop(key)) is not None}
            for group, keys in groups.items()
        } | values

    def _driver(self) -> dict[str, Any]:
        """Return the private parameters of the driver's node."""
        lsl = self._lsl() if self.transport == "lsl" and self.device == EMULATED else self.lsl
        values = {"source": self.transport, "chunk": self.chunk, **self.record()["driver"]}
        return values | ({"lsl": lsl} if lsl else {})

    def _emulated(self, seed: int) -> dict[str, Any]:
        """Return the private parameters of the emulated device."""
        values = {"transport": self.transport, "rate": self.rate, "seed": seed, "block": min(self.chunk / 2, BLOCK)}
        lsl = {key: self._lsl()[key] for key in ("name", "session")} if self.transport == "lsl" else {}
        return {**values, **located(self.emulated, Path.cwd()), **lsl}

    def _lsl(self) -> dict[str, Any]:
        return {"name": self.emulated_name, "session": session(), **(self.lsl or {})}

    def _source(self, topic: str, units: Mapping[str, Sequence[str]]) -> dict[str, Any]:
        """Return the synchroniser's source, with a time code that shows its skew; units: channels of each unit."""
        code = {"s": ["time"]} if self.time_code and self.transport == "lsl" else {}
        signals = [
            {"field": f"data[{', '.join(channels)}]", "unit": unit} for unit, channels in {**units, **code}.items()
        ]
        return {"topic": topic, "type": "hric_msgs/SampleChunk", "max_gap": CHUNK_GAP, "signals": signals}


@dataclass(frozen=True)
class EmulatedEmg(Settings):
    """The mapping `emulated` of EMG."""

    activation: Settings = ACTIVATION
    amplitude: float = number(AMPLITUDE, minimum=0.0, maximum=1.0, unit="V")
    faults: Faults = section(Faults)


@dataclass(frozen=True)
class EmgSection(SensorSection):
    """The section `emg`."""

    name, emulated_name = "emg", "emulated_emg"
    driver_keys = ("envelope", "lsl", "trigno")
    transport: str = choice("lsl", "trigno", text="by which EMG comes")
    channels: tuple[str, ...] = muscle_names("how many of the usual muscles, or names, which a real stream needs")
    rate: float = number(2000.0, minimum=100.0, maximum=20_000.0, unit="Hz", text="of the emulated device")
    envelope: Mapping[str, Any] | None = for_node(section(EnvelopeSettings), "how it is made: hric_perception")
    trigno: Mapping[str, Any] | None = for_node(section(TrignoSettings), "which server: hric_perception")

    def check(self, where: str) -> None:
        """Refuse what the emulated device does not accept."""
        program = EmulatedEmg.of(self.emulated, f"{where}emulated").activation
        if isinstance(program, RecordedEmg):
            program.replayed(self.channels)
        elif isinstance(program, Program):
            program.activation(len(self.channels))

    @property
    def measures_him(self) -> bool:
        """True if the emulated device measures the muscles of a simulated human."""
        program = EmulatedEmg.of(self.emulated, "emulated").activation
        return self.device == EMULATED and isinstance(program, TopicActivation)

    def nodes(self, seed: int) -> dict[str, dict[str, Any]]:
        """Return the private parameters of the driver and of the emulated device, by node name."""
        given, names = dict(self.trigno or {}), list(self.channels)
        driver, trigno = self._driver(), self.transport == "trigno"
        if trigno:
            driver["trigno"] = {**given, "channels": names + ["time"] * self.time_code}
        if self.device != EMULATED:
            return {self.name: driver}
        server = {"host": "ip", "command_port": "command_port", "data_port": "data_port"} if trigno else {}
        own = {"muscles": names} | {name: given[key] for key, name in server.items() if key in given}
        return {self.name: driver, self.emulated_name: self._emulated(seed) | own}

    @property
    def source(self) -> dict[str, Any]:
        """Source of the raw EMG for the plan of the synchroniser."""
        return self._source("hric/perception/emg/raw", {"V": self.channels})


@dataclass(frozen=True)
class EmulatedPlate(Settings):
    """The mapping `emulated` of a force plate."""

    load: Settings = loads.PROGRAM
    faults: Faults = section(Faults)
    natnet: Mapping[str, Any] = mapping(default={})


@dataclass(frozen=True)
class PlateStream(ClientSettings, Publishing):
    """The mapping `natnet` of a force plate."""

    plate: Any = number(0)


def _invertible(rows: Sequence[Sequence[float]]) -> Sequence[Sequence[float]]:
    if np.linalg.matrix_rank(rows) < 6:
        raise ValueError
    return rows


CALIBRATION: Any = listing(
    numbers(6),
    6,
    None,
    made=_invertible,
    unit="N/V, N m/V",
    text="(Fx .. Mz) = calibration * signals; c3d files then have the signals (type 4)",
)
CALIBRATION.accepts = "six rows of six numbers that can be inverted"


@dataclass(frozen=True)
class PlateSection(SensorSection):
    """The section `force_plate`."""

    name, emulated_name = "force_plate", "emulated_plate"
    driver_keys = ("id", "height", "invert", "pose", "lsl", "natnet")
    described_keys = ("size", "calibration")
    transport: str = choice("lsl", "natnet", text="by which the samples come")
    channels: tuple[str, ...] = CHANNELS
    rate: float = number(1000.0, minimum=10.0, maximum=20_000.0, unit="Hz", text="of the emulated device")
    id: str = PLATE_ID
    height: float | None = number(None, unit="m", text="of the surface over the origin of the device's moments")
    invert: bool | None = flag(None, text="whether the device reports the reaction, not the load")
    pose: Mapping[str, Any] | None = for_node(
        section(PlatePose), "`frame`, `xyz` [m], `xyzw` of the middle of the surface"
    )
    natnet: Mapping[str, Any] | None = for_node(section(PlateStream), "which server and `plate`: hric_perception")
    size: tuple[float, ...] = numbers(
        2, PLATE_SIZE, above=0.0, unit="m", text="of the surface along x and y, for c3d files"
    )
    calibration: tuple[tuple[float, ...], ...] | None = CALIBRATION

    @property
    def wire(self) -> str:
        """Text on the part that needs a wire: a real plate, or one over NatNet in the frames of its own Motive."""
        return super().wire or (f"{self.name} over natnet" if self.transport == "natnet" else "")

    @property
    def measures_him(self) -> bool:
        """True if the emulated device measures the human in the plant."""
        return self.device == EMULATED and measures_him(self.emulated.get("load"))

    def record(self) -> dict[str, Any]:
        """Return the values for run.yaml; a load from a simulated body's motion is marked as computed."""
        return super().record() | ({"computed": "load: from the simulated body's motion"} if self.measures_him else {})

    def check(self, where: str) -> None:
        """Refuse what the emulated device does not accept."""
        load = EmulatedPlate.of(self.emulated, f"{where}emulated").load
        if isinstance(load, RecordedLoad):
            load.replayed()

    def nodes(self, seed: int) -> dict[str, dict[str, Any]]:
        """Return the private parameters of the driver and of the emulated device, by node name."""
        driver = self._driver()
        if self.device != EMULATED:
            return {self.name: driver}
        pose = {key: value for key, value in (self.pose or {}).items() if key != "frame"}
        emulated = self._emulated(seed) | ({"pose": pose} if pose else {})
        if self.transport == "natnet":
            emulated["natnet"] = NATNET_PORTS | dict(self.emulated.get("natnet") or {})
            driver["natnet"] = {"server": "127.0.0.1", **NATNET_PORTS, **(self.natnet or {})}
        return {self.name: driver, self.emulated_name: emulated}

    @property
    def source(self) -> dict[str, Any]:
        """Source of the samples for the plan of the synchroniser."""
        units = {"N": self.channels[:3], "N m": self.channels[3:]}
        return self._source(f"hric/perception/force_plate/{self.id}/samples", units)


@dataclass(frozen=True)
class SyncSection(Settings):
    """The section `sync`."""

    rates: tuple[float, ...] = listing(
        number(above=0.0, maximum=10_000.0, unit="Hz"),
        range(1, 9),
        (100.0, 1000.0),
        different=True,
        unit="Hz",
        text="a stream for each: `/hric/perception/sync_<rate>hz`",
    )
    delay: float = number(
        1.0,
        minimum=0.0,
        maximum=10.0,
        unit="s",
        text="how long an instant waits for a late source; a busy machine may hold a sensor's process back (project "
        "default, unconfirmed)",
    )

    @property
    def topics(self) -> list[str]:
        """Topics of the synchronised samples, in the order of the rates."""
        return [rate_topic(TOPIC, rate) for rate in self.rates]

    def nodes(self, joints: Sequence[str], sources: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
        """Return the private parameters of the synchroniser, by its name.

        Args:
            joints: joints of the robot.
            sources: sources other than the robot.
        """
        signals = [f"{name}[{', '.join(joints)}]" for name in ("position", "velocity", "effort")]
        log = {"topic": "control_log", "type": "hric_msgs/ControlLog", "signals": signals}
        plan = {"policy": "resample", "rate": self.rates[0], "delay": self.delay, "sources": [log, *sources]}
        return {"synchronizer": {"plan": plan, "rates": list(self.rates)}}


@dataclass(frozen=True)
class PersonSection(PersonSettings):
    """The section `person`, with the parameters of the node of that name."""

    separator = "."


SECTIONS: dict[str, type[Settings]] = {
    "mocap": MocapSection,
    "emg": EmgSection,
    "force_plate": PlateSection,
    "sync": SyncSection,
    "human": HumanSettings,
    "person": PersonSection,
    "supervisor": SupervisorSettings,
}
"""Declaration of each section."""
