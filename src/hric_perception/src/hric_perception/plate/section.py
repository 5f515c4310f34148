"""Section `force_plate` of an experiment file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core.parameters import Settings, choice, flag, listing, mapping, number, numbers, section
from hric_perception.emulation import Faults
from hric_perception.plate import loads
from hric_perception.plate.geometry import CHANNELS, PLATE_ID, PLATE_SIZE, PlatePose
from hric_perception.plate.natnet import PlateClient
from hric_perception.replayed import RecordedLoad
from hric_perception.sampled import DeviceSettings, DriverSettings
from hric_perception.section import EMULATED, SensorSection, SourcePlan, for_node
from hric_perception.simulated import measures_person

NATNET_PORTS = {"command_port": 1512, "data_port": 1513}
"""UDP ports of the emulated Motive that streams only a plate (project default, unconfirmed).

They differ from the default ports, which an emulated motion capture uses.
"""


@dataclass(frozen=True)
class EmulatedPlate(Settings):
    """Mapping `emulated` of the section `force_plate`: the emulated plate."""

    load: Settings = loads.PROGRAM
    faults: Faults = section(Faults)
    natnet: Mapping[str, object] = mapping(default={})


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
    """Section `force_plate` of an experiment file: a force plate, real or emulated."""

    name, emulated_name = "force_plate", "emulated_plate"
    driver_keys = ("id", "height", "invert", "pose", "lsl", "natnet")
    described_keys = ("size", "calibration")
    transport: str = choice("lsl", "natnet", text="transport of the samples")
    channels: tuple[str, ...] = CHANNELS
    id: str = PLATE_ID
    height: float | None = number(None, unit="m", text="height of the surface above the origin of the device's moments")
    invert: bool | None = flag(None, text="true: the device reports the reaction, not the load")
    pose: Mapping[str, object] | None = for_node(
        section(PlatePose), "`frame`, `xyz` [m], `xyzw` of the middle of the surface"
    )
    natnet: Mapping[str, object] | None = for_node(
        section(PlateClient), "NatNet connection and `plate`, see hric_perception"
    )
    size: tuple[float, ...] = numbers(
        2, PLATE_SIZE, above=0.0, unit="m", text="size of the surface along x and y, for c3d files"
    )
    calibration: tuple[tuple[float, ...], ...] | None = CALIBRATION

    @classmethod
    def parts(cls) -> tuple[type[DriverSettings], type[DeviceSettings]]:
        """Return the parameter classes of the driver's node and of the emulated device's node."""
        from hric_perception.plate.device import EmulatedPlateSettings
        from hric_perception.plate.publisher import ForcePlateSettings

        return ForcePlateSettings, EmulatedPlateSettings

    @property
    def wire(self) -> str:
        """Name, for messages, of what needs a network: a real plate, or any plate over NatNet; "": nothing."""
        return super().wire or (f"{self.name} over natnet" if self.transport == "natnet" else "")

    @property
    def follows(self) -> str:
        """Full name of the key `load` if it makes the emulated plate measure the simulated human; else ""."""
        measured = self.device == EMULATED and measures_person(self.emulated.get("load"))
        return f"{self.name}.emulated.load" if measured else ""

    def record(self) -> dict[str, object]:
        """Return the section's values for run.yaml, with a note if the load is computed from a simulated motion."""
        return super().record() | ({"computed": "load: from the simulated body's motion"} if self.follows else {})

    def check(self, where: str) -> None:
        """Check the trial of a recorded load, as the emulated device would. Raises ParameterError."""
        load = EmulatedPlate.of(self.emulated, f"{where}emulated").load
        if isinstance(load, RecordedLoad):
            load.replayed()

    def nodes(self, seed: int, person: Mapping[str, object]) -> dict[str, dict[str, object]]:
        """Return the private parameters of driver and emulated device, by the names of the nodes."""
        parameters = super().nodes(seed, person)
        if (device := parameters.get(self.emulated_name)) is None:
            return parameters
        pose = {key: value for key, value in (self.pose or {}).items() if key != "frame"}
        device |= ({"pose": pose} if pose else {}) | ({"person": person["person"]} if self.follows else {})
        if self.transport == "natnet":
            device["natnet"] = NATNET_PORTS | dict(self.emulated.get("natnet") or {})
            parameters[self.name]["natnet"] = {"server": "127.0.0.1", **NATNET_PORTS, **(self.natnet or {})}
        return parameters

    @property
    def source(self) -> SourcePlan:
        """Entry of the plate's samples in the synchroniser's plan."""
        units = {"N": self.channels[:3], "N m": self.channels[3:]}
        return self._source(f"hric/perception/force_plate/{self.id}/samples", units)
