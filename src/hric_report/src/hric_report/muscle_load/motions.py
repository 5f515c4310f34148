"""Muscle load of a motion recorded in a run: motion of the simulated human, or of a person tracked by cameras."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hric_assessment.ergonomics.muscle_load import load_of, motion_of
from hric_bags import reader as bag_reader
from hric_bags.records import tracked_person
from hric_bags.records.human_record import HumanRecord
from hric_bags.run_folder import RunFolder
from hric_core.geometry import Pose
from hric_human.body import Body
from hric_human.control.whole_body import ExternalLoad, RootMotion
from hric_human.muscles.after_run import CUTOFF, MuscleLoad, RecordedMotion
from hric_human.muscles.anatomy import Anatomy
from hric_human.muscles.choose import find
from hric_human.participant.settings import MuscleSettings
from hric_perception.person.settings import PersonSettings
from hric_report.muscle_load.person import DescribedPerson, MuscleLoadError

AS_SHIPPED = MuscleSettings()


@dataclass(frozen=True)
class MuscleLoadResult:
    """Muscle load of one motion.

    Attributes:
        load: load of muscles and joints.
        body: body model of the person.
        anatomy: muscle anatomy.
        notes: remarks for the reader: source of the motion, muscles, and forces that are or are not included.
    """

    load: MuscleLoad
    body: Body
    anatomy: Anatomy
    notes: tuple[str, ...]


def of_run(person: DescribedPerson, cutoff: float = CUTOFF) -> MuscleLoadResult:
    """Compute the muscle load of the simulated human's motion in a run.

    Args:
        person: simulated human of the run, with the recorded motion.
        cutoff: cut-off frequency of the low-pass filter of the joint angles [Hz].

    Raises:
        HricError: there is no recorded motion, it is too short, or the body has no arms.
    """
    record = person.record
    if record is None:
        raise MuscleLoadError(f"{person.source} describes a person but contains no motion; valid: a run, or a c3d file")
    motion, root = motion_of(record, list(person.body.joints), person.settings.root(person.body), cutoff)
    result = computed(person, motion, [f"motion: joint states of {person.source}"], root)
    return replace(result, notes=(*result.notes, _against(result.load, record)))


def _against(load: MuscleLoad, record: HumanRecord) -> str:
    """Return a note with the RMS difference between joint torques of inverse dynamics and those in the run's bag."""
    inside = (load.time >= record.torque_time[0]) & (load.time <= record.torque_time[-1])
    columns = [
        np.interp(load.time[inside], record.torque_time, record.torque[:, record.joints.index(name)])
        for name in load.joints
    ]
    error = np.sqrt(np.mean((load.torque[inside] - np.transpose(columns)) ** 2))
    return f"joint torques differ from those recorded in the run by {error:.3f} N m RMS"


def of_tracked(name: str, root: Path | None = None, muscles: MuscleSettings = AS_SHIPPED) -> MuscleLoadResult:
    """Compute the muscle load of the real person in front of the cameras, tracked again from the recorded frames.

    Args:
        name: path of a run folder, its name, or "latest".
        root: folder of all runs.
        muscles: anatomy and strength of the muscles.

    Raises:
        HricError: the run has no section `person`, or the person is not visible in its bag.
    """
    folder = RunFolder.open(name, root)
    run = folder.read()
    section = (run.get("definition") or {}).get("person")
    if section is None:
        raise MuscleLoadError(
            f"no person was tracked in {folder.path.name}; valid: a run of an experiment with a section person"
        )
    anatomy = find(muscles.anatomy, "--muscles")
    with bag_reader.opened(folder.bag_of(run)) as reader:
        settings = PersonSettings.of(section, "person")
        result = tracked_person.tracked(reader, bag_reader.read(reader).robot_time, settings, anatomy, muscles.strength)
    return MuscleLoadResult(result.load.load, result.body, anatomy, result.notes)


def computed(
    person: DescribedPerson,
    motion: RecordedMotion,
    notes: list[str],
    root: Pose | RootMotion,
    pressed: Sequence[ExternalLoad] = (),
) -> MuscleLoadResult:
    """Compute the muscle load of a motion.

    Args:
        person: person who moved, with their recorded grips.
        motion: joint angles over time.
        notes: remarks on the motion, to which remarks on muscles and forces are added.
        root: fixed pose of the body's root in the world, or its motion.
        pressed: further external loads on the body, at the times of the motion.
    """
    settings = person.settings.muscles
    anatomy = find(settings.anatomy, person.anatomy)
    loads = [*person.loads(motion.time), *pressed]
    load = load_of(person.body, anatomy, root, motion, loads, settings.strength, person.gravity)
    notes += [
        f"muscles: {anatomy.name}, {sum(load.is_muscle)} of them, strength {settings.strength:g}",
        f"external forces act on the links: {', '.join(force.link for force in loads) or 'none'}",
    ]
    notes += [
        f"NOT included: contact force on {contact.link}, at most {contact.force.max():.1f} N "
        "(the bag lacks its direction)"
        for contact in (person.record.contacts if person.record is not None else {}).values()
    ]
    for side, outside in load.outside.items():
        if outside.any():
            notes.append(
                f"{side} arm: for {100 * outside.mean():.1f} % of the time outside the range of the fitted muscle "
                "paths; "
                "its muscles are left out there"
            )
    return MuscleLoadResult(load, person.body, anatomy, tuple(notes))
