"""Input of a verdict: a run folder, a bag, or a c3d file with markers of a body."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from hric_assessment.verdict.markers import FRAMES, of_c3d, of_frames
from hric_bags.records import recording
from hric_bags.records.recording import Recording
from hric_bags.run_folder import RunFolder
from hric_perception.person.settings import PersonSettings


@dataclass(frozen=True)
class Given:
    """Recording and the files next to it.

    Attributes:
        name: name for texts.
        kind: run, bag or c3d.
        folder: folder for verdict.json.
        recording: recorded signals.
        run: contents of run.yaml; empty without a run folder.
        description: URDF of the robot; "": none.
    """

    name: str
    kind: str
    folder: Path
    recording: Recording
    run: Mapping[str, Any] = field(default_factory=dict)
    description: str = ""

    @property
    def definition(self) -> Mapping[str, Any]:
        """Definition of the experiment; empty without a run folder."""
        return self.run.get("definition") or {}

    @property
    def plant(self) -> Mapping[str, Any]:
        """Parameters of the plant; empty without a run folder."""
        return ((self.run.get("parameters") or {}).get("robot") or {}).get("plant") or {}


def opened(given: str, root: Path | None = None) -> Given:
    """Read the input of a verdict.

    Args:
        given: a run folder, its name, "latest", a bag, or a c3d file.
        root: folder of all runs.

    Raises:
        HricError: it does not exist, or cannot be read.
    """
    path = Path(given).expanduser()
    if path.suffix.lower() == ".c3d":
        return Given(path.stem, "c3d", path.parent, of_c3d(path))
    if path.suffix == ".bag" and not (path / "run.yaml").is_file():
        found = recording.read(path)
        return _with_markers(Given(path.stem, "bag", path.parent, found, {}, found.description), path)
    folder = RunFolder.open(given, root)
    run = folder.read()
    bag = folder.path / str(run.get("bag", folder.bag_path.name))
    found = recording.read(bag)
    description = folder.description() or found.description
    return _with_markers(Given(folder.path.name, "run", folder.path, found, run, description), bag)


def _with_markers(given: Given, bag: Path) -> Given:
    """Return the recording with the person from motion capture frames, if no other signal shows a person."""
    found = given.recording
    if found.humans or found.people or FRAMES not in found.kinds:
        return given
    states = of_frames(bag, found, PersonSettings.of(given.definition.get("person") or {}, "person"))
    if states is None:
        return given
    joints, root = states
    return replace(given, recording=replace(found, people={joints.topic: joints}, tracked={root.topic: root}))
