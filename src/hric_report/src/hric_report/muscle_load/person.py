"""Description of the person whose muscle load is computed, from a run or experiment file, with recorded forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hric_assessment.ergonomics.muscle_load import grip_loads
from hric_bags import reader as bag_reader
from hric_bags.records import human_record
from hric_bags.records.human_record import HumanRecord
from hric_bags.run_file import NodeParameters, robot_parameters
from hric_bags.run_folder import RunFolder
from hric_control.plants import WindowlessConfig
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Vector
from hric_human.body import Body
from hric_human.control.whole_body import ExternalLoad
from hric_human.participant.settings import HumanSettings, MuscleSettings
from hric_run.definition import experiment


class MuscleLoadError(HricError):
    """Error: the recording lacks data that the muscle load needs."""


@dataclass(frozen=True)
class DescribedPerson:
    """Person whose muscle load is computed: body, muscle settings, and recorded forces on them.

    Attributes:
        settings: settings of the simulated human, with the pose of the body in the world.
        body: body model.
        gravity: gravity vector in the world frame [m/s^2].
        record: motion and forces from a run's bag; None: the person is described by an experiment file.
        source: name of the run or file that describes the person, for messages.
        anatomy: name of the parameter or option that selects the muscle anatomy, for messages.
    """

    settings: HumanSettings
    body: Body
    gravity: Vector
    record: HumanRecord | None
    source: str
    anatomy: str = "human.muscles.anatomy"

    def with_muscles(self, anatomy: str | None, strength: float | None) -> "DescribedPerson":
        """Return a copy with another muscle anatomy or strength factor; None leaves the value unchanged."""
        muscles = choose(self.settings.muscles, anatomy, strength)
        where = self.anatomy if anatomy is None else "--muscles"
        return replace(self, settings=replace(self.settings, muscles=muscles), anatomy=where)

    def loads(self, time: FloatArray) -> list[ExternalLoad]:
        """Return the external loads of the recorded grips on the body; `time`: times, shape (n,) [s]."""
        return [] if self.record is None else grip_loads(self.record.grips.values(), time)


def choose(settings: MuscleSettings, anatomy: str | None, strength: float | None) -> MuscleSettings:
    """Return a copy of muscle settings with anatomy and strength replaced, each unless it is None."""
    factor = settings.strength if strength is None else strength
    return replace(settings, anatomy=anatomy or settings.anatomy, strength=factor)


def described_by(name: str, root: Path | None = None) -> DescribedPerson:
    """Read the description of a person from a run or from an experiment file.

    Args:
        name: path of a run folder, its name, "latest", or the path of a YAML file.
        root: folder of all runs.

    Raises:
        HricError: the run or file does not exist, or has no human.
    """
    if name.endswith((".yaml", ".yml")):
        section: NodeParameters | None = experiment.load(name, []).human
        return _described(section, WindowlessConfig().gravity, None, name)
    folder = RunFolder.open(name, root)
    run = folder.read()
    section = (run.get("definition") or {}).get("human")
    if section is None:
        raise MuscleLoadError(f"{folder.path.name} has no human; valid: a run of an experiment with a section human")
    with bag_reader.opened(folder.bag_of(run)) as reader:
        record = human_record.read(reader, bag_reader.read(reader).robot_time)
    if record is None:
        raise MuscleLoadError(
            f"the bag of {folder.path.name} has no motion of the human; valid: a bag with the topics "
            "hric/human/joint_states and hric/human/joint_torque"
        )
    plant = robot_parameters(run).get("plant") or {}
    return _described(section, plant.get("gravity") or WindowlessConfig().gravity, record, folder.path.name)


def _described(
    section: NodeParameters | None, gravity: Sequence[float], record: HumanRecord | None, source: str
) -> DescribedPerson:
    if section is None:
        raise MuscleLoadError(f"{source} has no human; valid: an experiment with a section human")
    settings = HumanSettings.of(section, "human")
    x, y, z = map(float, gravity)
    return DescribedPerson(settings, settings.body(), (x, y, z), record, source)
