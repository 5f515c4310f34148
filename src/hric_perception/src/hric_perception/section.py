"""Base class of an experiment file's section for an evenly sampled sensor.

A package exports the sections of its sensors as plugins of the base `hric_perception::Sensor`, by the name of the
section. This declaration defines the keys in the file, their schema and overrides, the parameters of the nodes, the
source of the synchroniser, and the sensor of a headless run.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, TypedDict
from urllib.parse import urlparse

from hric_core.node import Node
from hric_core.parameters import Parameter, Settings, choice, mapping, number, section
from hric_core.trial.c3d import located
from hric_perception.sampled import DeviceSettings, DriverSettings, HeadlessSensor, LslSettings, headless

EMULATED, REAL, NONE = "emulated", "real", "none"
BLOCK = 0.02
"""Longest time between two sendings of an emulated device [s of wall time], as of real ones (project default,
unconfirmed)."""
CHUNK_GAP = 0.01
"""Longest time between two samples across which the synchroniser interpolates [s]: lost samples are not bridged.

Project default, unconfirmed.
"""


class SignalPlan(TypedDict):
    """Signals of one source in the synchroniser's plan: path of the message fields, and their unit."""

    field: str
    unit: str


class SourcePlan(TypedDict):
    """Source in the synchroniser's plan; max_gap: longest time between samples for interpolation [s]."""

    topic: str
    type: str
    max_gap: float
    signals: list[SignalPlan]


def session() -> str:
    """Return the LSL session of emulated devices, named by the ROS master's port: unique per bring-up on a machine."""
    return f"hric_{urlparse(os.environ.get('ROS_MASTER_URI', '')).port or 11311}"


def for_node(declaration: Parameter, text: str) -> Any:
    """Return a parameter for a mapping that a node reads: checked by the node's declaration, stored unconverted."""

    def convert(value: Any, where: str, joints: Sequence[str]) -> dict[str, object]:
        declaration.checked(value, where, joints)
        return dict(value)

    return Parameter("mapping", declaration.accepts, convert, None, text=text, shape=declaration.shape)


@dataclass(frozen=True)
class SensorSection(Settings):
    """Section of an evenly sampled sensor; a subclass declares the channels and the source of the samples."""

    name: ClassVar[str]
    """Name of the section, and of the driver's node."""
    emulated_name: ClassVar[str]
    """Name of the emulated device's node, and of its LSL stream."""
    driver_keys: ClassVar[tuple[str, ...]] = ("lsl",)
    """Keys that the driver's node reads."""
    described_keys: ClassVar[tuple[str, ...]] = ()
    """Keys that are only used in exported files, such as c3d."""
    transport: str = choice("lsl", text="transport of the samples")
    channels: tuple[str, ...] = ()
    rate: float = number(1000.0, minimum=10.0, maximum=20_000.0, unit="Hz", text="sample rate of the emulated device")
    device: str = choice(EMULATED, REAL, NONE, text="real: without the emulated device; none: without the sensor")
    chunk: float = number(
        0.05,
        minimum=0.001,
        maximum=1.0,
        unit="s",
        text="duration of a message; a few large ones cost less than many small ones (project default, unconfirmed)",
    )
    lsl: Mapping[str, object] | None = for_node(
        section(LslSettings), "selection of the LSL stream, see hric_perception"
    )
    emulated: Mapping[str, Any] = mapping(default={}, text="what the emulated device measures, and its `faults`")

    @classmethod
    def parts(cls) -> tuple[type[DriverSettings], type[DeviceSettings]]:
        """Return the parameter classes of the driver's and the device's node; their modules are imported only here."""
        raise NotImplementedError

    @property
    def source(self) -> SourcePlan:
        """Entry of this sensor in the synchroniser's plan."""
        raise NotImplementedError

    @property
    def used(self) -> bool:
        """True if the sensor is part of the run."""
        return self.device != NONE

    @property
    def time_code(self) -> bool:
        """True if one channel has the robot time of each sample as its value."""
        return self.device == EMULATED and bool((self.emulated.get("faults") or {}).get("time_code", False))

    @property
    def wire(self) -> str:
        """Name, for messages, of the part of the sensor that needs a network connection; "": none."""
        return f"a real {self.name}" if self.device == REAL else ""

    @property
    def follows(self) -> str:
        """Full name of the key that makes the emulated device measure the simulated human's body; "": it does not."""
        return ""

    def record(self) -> dict[str, object]:
        """Return the section's values for run.yaml; those of the driver and those for exported files are grouped."""
        grouped = {*self.driver_keys, *self.described_keys}
        values = {item.name: getattr(self, item.name) for item in fields(self) if item.name not in grouped}
        return {"driver": self._set(self.driver_keys), "described": self._set(self.described_keys), **values}

    def nodes(self, seed: int, person: Mapping[str, object]) -> dict[str, dict[str, object]]:
        """Return the private parameters of driver and emulated device, by the names of the nodes.

        Args:
            seed: seed of all randomness.
            person: parameters `person` and `world_from_base` of a node, which describe the simulated human; empty:
                there is none.
        """
        emulated = {self.emulated_name: self._emulated(seed)} if self.device == EMULATED else {}
        return {self.name: self._driver()} | emulated

    def headless(self, node: Node) -> HeadlessSensor:
        """Return the emulated device with its driver in this process; node: node in the robot's namespace."""
        driver_node, device_node = node.child(self.name), node.child(self.emulated_name)
        driver, device = self.parts()
        return headless(driver.read(driver_node), device.read(device_node), driver_node, device_node)

    def _set(self, keys: Sequence[str]) -> dict[str, object]:
        return {key: value for key in keys if (value := getattr(self, key)) is not None}

    def _driver(self) -> dict[str, object]:
        lsl = self._lsl() if self.transport == "lsl" and self.device == EMULATED else self.lsl
        values = {"source": self.transport, "chunk": self.chunk, **self._set(self.driver_keys)}
        return values | ({"lsl": lsl} if lsl else {})

    def _emulated(self, seed: int) -> dict[str, object]:
        values = {"transport": self.transport, "rate": self.rate, "seed": seed, "block": min(self.chunk / 2, BLOCK)}
        lsl = {key: self._lsl()[key] for key in ("name", "session")} if self.transport == "lsl" else {}
        return {**values, **located(self.emulated, Path.cwd()), **lsl}

    def _lsl(self) -> dict[str, object]:
        return {"name": self.emulated_name, "session": session(), **(self.lsl or {})}

    def _source(self, topic: str, units: Mapping[str, Sequence[str]]) -> SourcePlan:
        """Return a source with its time code, if any, from which skew is computed; units: channels by unit."""
        code = {"s": ["time"]} if self.time_code and self.transport == "lsl" else {}
        signals: list[SignalPlan] = [
            {"field": f"data[{', '.join(channels)}]", "unit": unit} for unit, channels in {**units, **code}.items()
        ]
        return {"topic": topic, "type": "hric_msgs/SampleChunk", "max_gap": CHUNK_GAP, "signals": signals}
