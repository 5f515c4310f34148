"""Sections `mocap`, `sync`, `human`, `person`, `supervisor` of an experiment file; other sections are plugins.

Each section is declared by one settings class, which is used to read files, to derive parameters of nodes and sources
of the synchroniser, and to print the table in INTERFACE.md. Mappings that are meant for a node are checked by the
settings classes of that node's package and passed on unchanged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hric_bags.run_file import NodeParameters
from hric_core import plugins
from hric_core.parameters import Settings, listing, mapping, number, refused, text
from hric_core.trial.c3d import located
from hric_human.participant.settings import HumanSettings
from hric_perception.person.settings import PersonSettings
from hric_perception.simulated import measures_person
from hric_perception.sync.messages import TOPIC, rate_topic
from hric_run.definition.parameters import EMULATED_HUMAN, MOCAP_CLIENT
from hric_supervisor.settings import SupervisorSettings

if TYPE_CHECKING:
    from hric_core.local.node import LocalNode
    from hric_perception.human import CapturedHuman
    from hric_run.simulation import Stepper

FRAMES = "hric/perception/mocap"
STATE_TOPIC = "franka_state_controller/franka_states"
"""Topic of the arm's state, relative to the namespace of the arm."""
MOCAP_GAP = 0.05
"""Longest time between two frames that the synchroniser interpolates, so that occlusions are not bridged [s].

Project default, unconfirmed."""


@dataclass(frozen=True)
class MocapSection(Settings):
    """Section `mocap` of an experiment file: motion capture, and an emulated human that it tracks."""

    body: str = text(
        "",
        figures=True,
        text="body whose position is published on `/mocap/marker` and compared with the end effector's; empty: hand",
    )
    arm: str = text(
        "",
        text="with `arms`: the arm in whose base `base_from_mocap` and the motion of the emulated human are given, "
        "and to which this human reacts",
    )
    stream: NodeParameters = mapping(default={}, text="settings of the emulated Motive: see hric_perception")
    human: NodeParameters = mapping(default={}, text="settings of the emulated human: see hric_perception")
    base_from_mocap: NodeParameters | None = mapping(
        default=None,
        text="`xyz` [m] and `xyzw`: pose of the mocap frame, z up, in the robot's base; none: not known, positions "
        "stay in the mocap frame",
    )

    def check(self, where: str) -> None:
        """Refuse values that the emulated human or Motive does not accept, and a body that is not streamed."""
        seen = self.build(0, {"person": {}} if self.measures_person else {})  # body names do not depend on the person
        bodies = [body.name for body in seen.motive.scene.bodies]
        object.__setattr__(self, "body", self.body or seen.name)
        if self.body not in bodies:
            raise refused(f"{where}body", self.body, ", ".join(bodies))

    @property
    def measures_person(self) -> bool:
        """True if the motion capture tracks the simulated human in the robot's plant."""
        return measures_person(self.human)

    def build(self, seed: int, person: Mapping[str, object]) -> "CapturedHuman":
        """Return the emulated human and the emulated Motive that tracks them.

        Args:
            seed: seed of all random numbers.
            person: result of `parameters.person`; needed if `measures_person` is True.

        Raises:
            HricError: a value is not valid.
        """
        # Imported only for runs with a human.
        from hric_perception.human import see

        return see(self.human, self.stream, self.base_from_mocap, seed, self.prefix, **person)

    def nodes(self, base_frame: str, seed: int, person: Mapping[str, object]) -> dict[str, dict[str, object]]:
        """Return the private parameters of the motion capture client and the emulated human, by node name.

        `person`: result of `parameters.person`; needed if `measures_person` is True."""
        frame = {"base_frame": base_frame}
        base = {} if self.base_from_mocap is None else {"base_from_mocap": dict(self.base_from_mocap)}
        ports = {key: self.stream[key] for key in ("command_port", "data_port") if key in self.stream}
        client = {"body": self.body, "up_axis": self.stream.get("up_axis", "y"), **ports, **base}
        human = {"human": located(self.human, Path.cwd()), "stream": dict(self.stream), **base, **frame, "seed": seed}
        human |= {"state_topic": f"{self.arm}/{STATE_TOPIC}"} if self.arm else {}
        human |= person if self.measures_person else {}
        return {MOCAP_CLIENT: client | (frame if base else {}), EMULATED_HUMAN: human}

    @property
    def follows(self) -> str:
        """Full name of the key that makes motion capture track the human in the robot's plant; empty: it does not."""
        return "mocap.human" if self.measures_person else ""

    @property
    def source(self) -> dict[str, object]:
        """Source of motion capture poses in the configuration of the synchroniser."""
        signals = [f"rigid_bodies[{self.body}].pose"]
        return {"topic": FRAMES, "type": "hric_msgs/MocapData", "max_gap": MOCAP_GAP, "signals": signals}


@dataclass(frozen=True)
class SyncSection(Settings):
    """Section `sync` of an experiment file: the synchroniser, which resamples all sources to common times."""

    rates: tuple[float, ...] = listing(
        number(above=0.0, maximum=10_000.0, unit="Hz"),
        range(1, 9),
        (100.0, 1000.0),
        different=True,
        unit="Hz",
        text="rates of the synchronised streams, each on a topic `/hric/perception/sync_<rate>hz`",
    )
    delay: float = number(
        1.0,
        minimum=0.0,
        maximum=10.0,
        unit="s",
        text="longest wait for the samples of a late source, e.g. of a sensor's process on a busy machine (project "
        "default, unconfirmed)",
    )

    @property
    def topics(self) -> list[str]:
        """Topics of the synchronised samples, in the order of the rates."""
        return [rate_topic(TOPIC, rate) for rate in self.rates]

    def nodes(self, joints: Sequence[str], sources: Sequence[Mapping[str, object]]) -> dict[str, dict[str, object]]:
        """Return the private parameters of the synchroniser, by node name.

        Args:
            joints: names of the robot's joints.
            sources: configurations of the sources other than the robot.
        """
        signals = [f"{name}[{', '.join(joints)}]" for name in ("position", "velocity", "effort")]
        log = {"topic": "control_log", "type": "hric_msgs/ControlLog", "signals": signals}
        plan = {"policy": "resample", "rate": self.rates[0], "delay": self.delay, "sources": [log, *sources]}
        return {"synchronizer": {"plan": plan, "rates": list(self.rates)}}


@dataclass(frozen=True)
class PersonSection(PersonSettings):
    """Section `person` of an experiment file: parameters of the node `person`, which tracks a real person."""

    separator = "."


@dataclass(frozen=True)
class ExperimentSection(Settings):
    """Base class of sections that other packages define, for headless runs (one process without ROS).

    A package exports its subclass as a plugin `hric_run::Section`, under the name of the section."""

    separator = "."

    def headless(self, node: "LocalNode", seed: int) -> "Stepper | None":
        """Return the object that is advanced in step with the robot during the run; None: there is none.

        Args:
            node: node of the robot's namespace.
            seed: seed of all random numbers of the run.
        """
        raise NotImplementedError


SECTIONS: dict[str, type[Settings]] = {
    "mocap": MocapSection,
    "sync": SyncSection,
    "human": HumanSettings,
    "person": PersonSection,
    "supervisor": SupervisorSettings,
}
"""Settings class of each section that is not a plugin, by name of the section."""


def section_of(name: str) -> type[Settings]:
    """Return the settings class of a section. Raises HricError if it is a plugin that cannot be imported."""
    base = plugins.SECTION if name in plugins.names(plugins.SECTION) else plugins.SENSOR
    return SECTIONS.get(name) or plugins.find(base, name)
