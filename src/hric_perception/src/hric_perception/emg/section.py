"""Section `emg` of an experiment file."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hric_core.parameters import Settings, choice, number, section
from hric_human.control.human_control import ControlSettings, hand_side
from hric_human.participant.settings import HumanSettings
from hric_perception.emg.envelope import EnvelopeSettings as EnvelopeSettings
from hric_perception.emg.muscles import AMPLITUDE, PROGRAM, ActivationProgram, TopicActivation, muscle_names
from hric_perception.emulation import Faults
from hric_perception.replayed import RecordedEmg
from hric_perception.sampled import DeviceSettings, DriverSettings
from hric_perception.section import SensorSection, SourcePlan, for_node
from hric_perception.simulated import HUMAN
from hric_perception.trigno.client import TrignoSettings as TrignoSettings


@dataclass(frozen=True)
class EmulatedEmg(Settings):
    """Mapping `emulated` of the section `emg`: the emulated muscles."""

    activation: Settings = PROGRAM
    amplitude: float = number(AMPLITUDE, minimum=0.0, maximum=1.0, unit="V")
    faults: Faults = section(Faults)


@dataclass(frozen=True)
class EmgSection(SensorSection):
    """Section `emg` of an experiment file: an EMG sensor, real or emulated."""

    name, emulated_name = "emg", "emulated_emg"
    driver_keys = ("envelope", "lsl", "trigno")
    transport: str = choice("lsl", "trigno", text="transport of the EMG")
    channels: tuple[str, ...] = muscle_names(
        "number of muscles of the default list, or names of muscles; a real stream needs the names"
    )
    rate: float = number(2000.0, minimum=100.0, maximum=20_000.0, unit="Hz", text="sample rate of the emulated device")
    envelope: Mapping[str, object] | None = for_node(
        section(EnvelopeSettings), "filters and normalisation of the envelope, see hric_perception"
    )
    trigno: Mapping[str, object] | None = for_node(
        section(TrignoSettings), "connection to the Trigno server, see hric_perception"
    )

    @classmethod
    def parts(cls) -> tuple[type[DriverSettings], type[DeviceSettings]]:
        """Return the parameter classes of the driver's node and of the emulated device's node."""
        from hric_perception.emg.device import EmulatedEmgSettings
        from hric_perception.emg.publisher import EmgSettings

        return EmgSettings, EmulatedEmgSettings

    def check(self, where: str) -> None:
        """Check that the activation program suits the channels, as the emulated device would. Raises ParameterError."""
        program = EmulatedEmg.of(self.emulated, f"{where}emulated").activation
        if isinstance(program, RecordedEmg):
            program.replayed(self.channels)
        elif isinstance(program, ActivationProgram):
            program.activation(len(self.channels))

    def nodes(self, seed: int, person: Mapping[str, object]) -> dict[str, dict[str, object]]:
        """Return the private parameters of driver and device; default muscles are of a simulated human's active arm."""
        parameters, settings, names = super().nodes(seed, person), dict(self.trigno or {}), list(self.channels)
        trigno, device = self.transport == "trigno", parameters.get(self.emulated_name)
        if trigno:
            parameters[self.name]["trigno"] = {**settings, "channels": names + ["time"] * self.time_code}
        if device is not None:
            server = {"host": "ip", "command_port": "command_port", "data_port": "data_port"} if trigno else {}
            device |= {"muscles": names} | {name: settings[key] for key, name in server.items() if key in settings}
            if person and isinstance(EmulatedEmg.of(self.emulated, "emulated").activation, TopicActivation):
                device["activation"] = {"side": _following_side(person["person"]), **self.emulated["activation"]}
        return parameters

    @property
    def source(self) -> SourcePlan:
        """Entry of the EMG samples in the synchroniser's plan."""
        return self._source("hric/perception/emg/raw", {"V": self.channels})


def _following_side(human: Any) -> str:
    """Return the side, "right" or "left", of the hand with which a simulated human acts; human: section `human`."""
    person = HumanSettings.of(human, HUMAN)
    control = ControlSettings.of(person.control, f"{person.prefix}control")
    return hand_side(person.body(), control.side, person.prefix)
