"""Sections `mocap`, `sync`, `human`, `person`, `supervisor` of an experiment file; others are plugins.

Each is declared once: files are read by it, parameters of nodes and sources of the synchroniser follow from it, and
INTERFACE.md prints it. Mappings for a node are checked by the declarations of that node's package and passed on
unchanged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hric_assessment.supervisor.settings import SupervisorSettings
from hric_bags.run_file import NodeParameters
from hric_core import plugins
from hric_core.parameters import Settings, listing, mapping, number, refused, text
from hric_core.trial.c3d import located
from hric_human.participant.settings import HumanSettings
from hric_perception.person.settings import PersonSettings
from hric_perception.simulated import measures_person
from hric_perception.sync.messages import TOPIC, rate_topic
from hric_run.definition.parameters import EMULATED_HUMAN, MOCAP_CLIENT

if TYPE_CHECKING:
    from hric_core.local.node import LocalNode
    from hric_perception.human import CapturedHuman
    from hric_run.simulation import Stepper

FRAMES = "hric/perception/mocap"
MOCAP_GAP = 0.05
"""Longest time between frames that are interpolated [s]: an occlusion is not bridged (project default, unconfirmed)."""


@dataclass(frozen=True)
class MocapSection(Settings):
    """The section `mocap`."""

    body: str = text(
        "",
        figures=True,
        text="body whose position is published on `/mocap/marker` and compared with the end effector's; empty: hand",
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
        seen = self.build(0, {"person": {}} if self.measures_person else {})  # names are the same for any person
        bodies = [body.name for body in seen.motive.scene.bodies]
        object.__setattr__(self, "body", self.body or seen.name)
        if self.body not in bodies:
            raise refused(f"{where}body", self.body, ", ".join(bodies))

    @property
    def measures_person(self) -> bool:
        """True if it tracks the human in the plant."""
        return measures_person(self.human)

    def build(self, seed: int, person: Mapping[str, object]) -> "CapturedHuman":
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

    def nodes(self, arm_id: str, seed: int, person: Mapping[str, object]) -> dict[str, dict[str, object]]:
        """Return private parameters of the client and the emulated human, by node name; person: see `build`."""
        frame = {"base_frame": f"{arm_id}_link0"}
        base = {} if self.base_from_mocap is None else {"base_from_mocap": dict(self.base_from_mocap)}
        ports = {key: self.stream[key] for key in ("command_port", "data_port") if key in self.stream}
        client = {"body": self.body, "up_axis": self.stream.get("up_axis", "y"), **ports, **base}
        human = {"human": located(self.human, Path.cwd()), "stream": dict(self.stream), **base, **frame, "seed": seed}
        human |= person if self.measures_person else {}
        return {MOCAP_CLIENT: client | (frame if base else {}), EMULATED_HUMAN: human}

    @property
    def follows(self) -> str:
        """Key of the mapping whose program measures the human in the robot's plant; "": none does."""
        return "mocap.human" if self.measures_person else ""

    @property
    def source(self) -> dict[str, object]:
        """Source of the poses for the plan of the synchroniser."""
        signals = [f"rigid_bodies[{self.body}].pose"]
        return {"topic": FRAMES, "type": "hric_msgs/MocapData", "max_gap": MOCAP_GAP, "signals": signals}


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
        text="waiting time for a late source; a busy machine may hold a sensor's process back (project "
        "default, unconfirmed)",
    )

    @property
    def topics(self) -> list[str]:
        """Topics of the synchronised samples, in the order of the rates."""
        return [rate_topic(TOPIC, rate) for rate in self.rates]

    def nodes(self, joints: Sequence[str], sources: Sequence[Mapping[str, object]]) -> dict[str, dict[str, object]]:
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


@dataclass(frozen=True)
class ExperimentSection(Settings):
    """Section of another package, a plugin `hric_run::Section` by the name of the section, for headless runs."""

    separator = "."

    def headless(self, node: "LocalNode", seed: int) -> "Stepper | None":
        """Return what advances in step with the robot; None: nothing does.

        Args:
            node: namespace of the robot.
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
"""Declaration of each section that is no plugin."""


def section_of(name: str) -> type[Settings]:
    """Return the declaration of a section. Raises HricError: a plugin that cannot be imported."""
    base = plugins.SECTION if name in plugins.names(plugins.SECTION) else plugins.SENSOR
    return SECTIONS.get(name) or plugins.find(base, name)
