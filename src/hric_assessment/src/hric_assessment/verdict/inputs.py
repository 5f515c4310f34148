"""Input of an assessment: a run folder, a bag, or a trial with markers of bodies."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from hric_assessment.findings import NotAssessableError
from hric_assessment.separation.capsules import CapsuleMotion, capsules_of, moved_by, shapeless
from hric_assessment.typed_json import Content
from hric_assessment.verdict.markers import FRAMES, of_frames, of_trial
from hric_bags import foreign
from hric_bags.reader import ControlRecord
from hric_bags.records import recording
from hric_bags.records.recording import Recording
from hric_bags.records.root_record import RootRecord
from hric_bags.run_file import RunFile
from hric_bags.run_folder import RunFolder
from hric_core import urdf
from hric_core.geometry import Pose, compose
from hric_motion.formats import FORMATS
from hric_motion.handovers import is_handover
from hric_perception.person.settings import PersonSettings

FILE = "verdict.json"
"""Name of the file with the verdict in a run folder."""
WORLD = "world"
"""Name of the frame in which persons and robots have their place."""


@dataclass(frozen=True)
class AssessmentInput:
    """Recording to be assessed, with the files next to it.

    Attributes:
        name: name of the recording in printed texts.
        kind: run, bag or c3d (any trial).
        folder: folder in which the verdict is written.
        recording: recorded signals.
        run: contents of run.yaml; empty without a run folder.
        description: URDF of the robot; "": not known.
    """

    name: str
    kind: str
    folder: Path
    recording: Recording
    run: RunFile = field(default_factory=RunFile)
    description: str = ""

    @property
    def verdict_file(self) -> Path:
        """File for the verdict: FILE in a run folder, NAME_verdict.json next to a bag or trial."""
        return self.folder / (FILE if self.kind == "run" else f"{self.name}_{FILE}")

    @property
    def definition(self) -> Content:
        """Definition of the experiment; empty without a run folder."""
        return self.run.get("definition") or {}

    @property
    def plant(self) -> Content:
        """Parameters of the plant; empty without a run folder."""
        return ((self.run.get("parameters") or {}).get("robot") or {}).get("plant") or {}

    def placed(self, frame: str) -> Pose | None:
        """Return the pose of a frame in the world by the static transforms; None: they do not lead to the world."""
        static, T_frame_goal = {key[1]: (key[0], pose) for key, pose in self.recording.static.items()}, Pose()
        while frame != WORLD and frame in static:
            frame, T_parent_frame = static.pop(frame)  # each once, so that a loop ends
            T_frame_goal = compose(T_parent_frame, T_frame_goal)
        return T_frame_goal if frame == WORLD else None

    def base(self, root: str) -> Pose | None:
        """Return the pose of the root link of the robot's description in the world; None: not known.

        A simulation has it at the world's origin.
        """
        return self.placed(root) or (Pose() if self.run else None)

    def arm(self, log: ControlRecord) -> tuple[CapsuleMotion, list[str]]:
        """Return the motion of the arm's capsules in the world, and the links that they leave out.

        Raises:
            NotAssessableError: the pose of the robot is not known.
        """
        tree = urdf.read(self.description)
        if (base := self.base(tree.root)) is None:
            raise NotAssessableError(
                f"the pose of the robot is not known: no static transform leads from world to {tree.root}, the root "
                "of its description (record /tf_static)"
            )
        capsules, left_out = capsules_of(tree, moved_by(tree, names := log.joint_names))
        return CapsuleMotion(tree, capsules, names, log.time, log.position, RootRecord.still(base).transforms), left_out

    @property
    def untouchable(self) -> str:
        """Reason why some links of a simulated arm cannot touch the person, a clause; "": all of them can."""
        log = self.recording.log
        if not self.definition.get("human"):
            return ""
        if self.plant.get("collision") is False:
            return "the robot touches nothing in this simulation (robot.plant.collision: false)"
        if not self.description or log is None:
            return ""
        tree = urdf.read(self.description)
        without = shapeless(tree, moved_by(tree, log.joint_names))
        return f"contacts of {', '.join(without)}, without collision shape, are not simulated" if without else ""


def opened(name: str, root: Path | None = None) -> AssessmentInput:
    """Read the recording to be assessed.

    Args:
        name: path or name of a run folder, "latest", or path of a bag or trial.
        root: folder of all runs.

    Raises:
        HricError: the recording does not exist, or cannot be read.
    """
    path = Path(name).expanduser()
    if path.suffix.lower() in FORMATS or is_handover(path):
        return AssessmentInput(path.stem, "c3d", path.parent, of_trial(path))
    if foreign.is_bag(path):
        signals = recording.read(path)
        return _with_markers(AssessmentInput(path.stem, "bag", path.parent, signals, {}, signals.description), path)
    folder = RunFolder.open(name, root)
    run = folder.read()
    bag = folder.bag_of(run)
    signals = recording.read(bag)
    description = folder.description() or signals.description
    return _with_markers(AssessmentInput(folder.path.name, "run", folder.path, signals, run, description), bag)


def _with_markers(source: AssessmentInput, bag: Path) -> AssessmentInput:
    """Add the person's motion from motion capture frames in the bag, if no other signal contains a person."""
    signals = source.recording
    if signals.humans or signals.people or FRAMES not in signals.kinds:
        return source
    states = of_frames(bag, signals, PersonSettings.of(source.definition.get("person") or {}, "person"))
    if states is None:
        return source
    joints, root = states
    return replace(source, recording=replace(signals, people={joints.topic: joints}, tracked={root.topic: root}))
