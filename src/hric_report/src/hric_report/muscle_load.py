"""Command muscle_load: muscle and joint load of a person's arms in a recorded motion. Needs no ROS master.

The motion comes from the joint states and grips of a run or from the markers of a c3d file; the load is computed by
`hric_human.muscles.after_run`. The output is a text table and .sto files for OpenSim, in the axes of its ground.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from hric_assessment.ergonomics.muscle_load import grip_loads, load_of, motion_of
from hric_bags import reader as bag_reader
from hric_bags import text
from hric_bags.arguments import run_arguments
from hric_bags.export.opensim_text import GROUND, write_storage
from hric_bags.files import atomic
from hric_bags.records import human_record, tracked_person
from hric_bags.records.human_record import HumanRecord
from hric_bags.run_folder import RunFolder
from hric_control.plants import WindowlessConfig
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose, Vector
from hric_core.geometry.poses import inverse
from hric_core.geometry.transforms import R_YUP_ZUP, rotation_from_quaternion
from hric_core.trial.c3d import read_trial
from hric_core.trial.plates import TrialPlate
from hric_human.body import Body, describe
from hric_human.body.markers import marker_labels
from hric_human.control import HumanControl
from hric_human.control.recorded import MarkerSolver
from hric_human.control.whole_body import Load, RootMotion
from hric_human.muscles.after_run import CUTOFF, Motion, MuscleLoad, smoothed
from hric_human.muscles.anatomy import Anatomy
from hric_human.muscles.choose import NAME, find
from hric_human.muscles.fatigue import Fatigue
from hric_human.muscles.static_optimization import MINIMUM
from hric_human.participant.settings import HumanSettings, MuscleSettings
from hric_perception.person.settings import PersonSettings
from hric_report.run import bag_of
from hric_run.definition import experiment

FOLDER = "muscle_load"
NO_PLATES: Mapping[int, str] = MappingProxyType({})
AS_SHIPPED = MuscleSettings()
HIGH = 0.3
"""Activation above which a muscle is counted as highly active [1]; project default."""
POOR_FIT, WORST_FIT = 0.015, 0.05
"""Distance of the markers from the body model (RMS, median over the frames) above which a note says that they may be
another person's, and above which the file is rejected [m]; project default."""


class MuscleLoadError(HricError):
    """Error: the recording lacks data that the muscle load needs."""


@dataclass(frozen=True)
class Described:
    """Description of the person who moved, and of the forces on them.

    Attributes:
        settings: settings of the simulated human, with the pose of the body in the world.
        body: body model.
        gravity: gravity in the world [m/s^2].
        record: recording from a run's bag; None: described by an experiment file, so no recorded forces act.
        source: name of the run or file that describes the person, for messages.
        anatomy: parameter or option that selects the muscle anatomy, for messages.
    """

    settings: HumanSettings
    body: Body
    gravity: Vector
    record: HumanRecord | None
    source: str
    anatomy: str = "human.muscles.anatomy"

    def with_muscles(self, anatomy: str | None, strength: float | None) -> "Described":
        """Return a copy with another muscle anatomy or another strength factor; None leaves the value unchanged."""
        muscles = _chosen(self.settings.muscles, anatomy, strength)
        where = self.anatomy if anatomy is None else "--muscles"
        return replace(self, settings=replace(self.settings, muscles=muscles), anatomy=where)

    def loads(self, time: FloatArray) -> list[Load]:
        """Return the loads of the grips on the links of the body at times of shape (n,) [s]."""
        return [] if self.record is None else grip_loads(self.record.grips.values(), time)


def _chosen(own: MuscleSettings, anatomy: str | None, strength: float | None) -> MuscleSettings:
    """Return the muscle settings with anatomy and strength replaced where they are not None."""
    return replace(own, anatomy=anatomy or own.anatomy, strength=own.strength if strength is None else strength)


@dataclass(frozen=True)
class Result:
    """Muscle load of one motion.

    Attributes:
        load: load of muscles and joints.
        body: body model of the person.
        anatomy: muscle anatomy.
        notes: remarks for the reader: how the motion was obtained, and which forces are not included.
    """

    load: MuscleLoad
    body: Body
    anatomy: Anatomy
    notes: tuple[str, ...]


def described_by(given: str, root: Path | None = None) -> Described:
    """Read the description of a person from a run or from an experiment file.

    Args:
        given: a run folder, its name, "latest", or the path of a YAML file.
        root: folder of all runs.

    Raises:
        HricError: no such run or file, or it has no human.
    """
    if given.endswith((".yaml", ".yml")):
        section: Mapping[str, Any] | None = experiment.load(given, []).human
        return _described(section, WindowlessConfig().gravity, None, given)
    folder = RunFolder.open(given, root)
    run = folder.read()
    section = (run.get("definition") or {}).get("human")
    if section is None:
        raise MuscleLoadError(f"{folder.path.name} has no human; valid: a run of an experiment with a section human")
    with bag_reader.opened(bag_of(folder, run)) as reader:
        record = human_record.read(reader, bag_reader.read(reader).robot_time)
    if record is None:
        raise MuscleLoadError(
            f"the bag of {folder.path.name} has no motion of its human; muscle load needs joint_states and "
            "joint torque of the human (hric/human/joint_states, hric/human/joint_torque)"
        )
    plant = ((run.get("parameters") or {}).get("robot") or {}).get("plant") or {}
    return _described(section, plant.get("gravity") or WindowlessConfig().gravity, record, folder.path.name)


def _described(
    section: Mapping[str, Any] | None, gravity: Sequence[float], record: HumanRecord | None, source: str
) -> Described:
    if section is None:
        raise MuscleLoadError(f"{source} has no human; valid: an experiment with a section human")
    settings = HumanSettings.of(section, "human")
    x, y, z = map(float, gravity)
    return Described(settings, describe(settings.person), (x, y, z), record, source)


def of_run(person: Described, cutoff: float = CUTOFF) -> Result:
    """Compute the muscle load of the motion that a run recorded.

    Args:
        person: person of the run.
        cutoff: cut-off frequency of the low-pass filter of the joint angles [Hz].

    Raises:
        HricError: no recorded motion, too short a motion, a body without arms.
    """
    record = person.record
    if record is None:
        raise MuscleLoadError(f"{person.source} describes somebody, and has no motion; valid: a run, or a c3d file")
    motion, root = motion_of(record, list(person.body.joints), person.settings.root(person.body), cutoff)
    result = _result(person, motion, [f"motion: joint states of {person.source}"], root)
    return replace(result, notes=(*result.notes, _against(result.load, record)))


def _against(load: MuscleLoad, record: HumanRecord) -> str:
    """Compare the joint torque of inverse dynamics with the logged torque; return a note with the RMS difference."""
    inside = (load.time >= record.torque_time[0]) & (load.time <= record.torque_time[-1])
    columns = [
        np.interp(load.time[inside], record.torque_time, record.torque[:, record.joints.index(name)])
        for name in load.joints
    ]
    error = np.sqrt(np.mean((load.torque[inside] - np.transpose(columns)) ** 2))
    return f"joint torque is {error:.3f} N m RMS from what the run logged"


def of_tracked(given: str, root: Path | None = None, muscles: MuscleSettings = AS_SHIPPED) -> Result:
    """Compute the muscle load of the real person in front of the cameras, tracked again from the recorded frames.

    Args:
        given: a run folder, its name, or "latest".
        root: folder of all runs.
        muscles: anatomy and strength of the muscles.

    Raises:
        HricError: the run has no section `person`, or the person is not visible in its bag.
    """
    folder = RunFolder.open(given, root)
    run = folder.read()
    section = (run.get("definition") or {}).get("person")
    if section is None:
        raise MuscleLoadError(f"{folder.path.name} tracked nobody; valid: a run of an experiment with a section person")
    anatomy = find(muscles.anatomy, "--muscles")
    with bag_reader.opened(bag_of(folder, run)) as reader:
        settings = PersonSettings.of(section, "person")
        result = tracked_person.tracked(reader, bag_reader.read(reader).robot_time, settings, anatomy, muscles.strength)
    return Result(result.found.load, result.body, anatomy, result.notes)


def of_c3d(
    path: Path,
    person: Described,
    cutoff: float = CUTOFF,
    plates: Mapping[int, str] = NO_PLATES,
) -> Result:
    """Compute the muscle load from the markers of a c3d file, whose laboratory frame is taken as the world frame.

    Times of the file are taken as times of the person's run; without a start time in the file they begin with the run.

    Args:
        path: c3d file.
        person: person who wears the markers, with the recorded grips of their run.
        cutoff: see `of_run`.
        plates: links of the body that press on the force plates of the file, by plate number from 1 on.

    Raises:
        HricError: no such file, no markers of the body in it, or they do not fit the body; no such plate or link.
    """
    trial, body = read_trial(path), person.body
    labels = marker_labels(path.name, trial.labels, tuple(body.markers))
    names = list(labels)
    T_root_world = inverse(person.settings.root(body))
    R = rotation_from_quaternion(T_root_world.orientation)
    positions = trial.markers([labels[name] for name in names]) @ R.T + np.array(T_root_world.position)
    seen = np.isfinite(positions).all(axis=2).any(axis=1)
    if not seen.any():
        raise MuscleLoadError(f"the markers of {path.name} are never seen")
    first, last = np.flatnonzero(seen)[[0, -1]]
    rows, distance = MarkerSolver(HumanControl(body, {}, 0).person, names).solve(positions[first : last + 1])
    worst = float(np.median(distance))
    if worst > WORST_FIT:
        raise MuscleLoadError(
            f"the markers of {path.name} are {1e3 * worst:.0f} mm from those of {person.source} (median over the "
            f"frames); valid: up to {1e3 * WORST_FIT:.0f} mm, in the same laboratory, of the same person"
        )
    time = trial.start + np.arange(first, last + 1) / trial.rate
    motion = smoothed(time, np.array(rows), cutoff)
    pressed = [plate_load(trial.plate(number), link, motion.time - trial.start) for number, link in plates.items()]
    note = f"motion: {len(names)} markers of {path.name}, {1e3 * worst:.1f} mm from those of the body (median)"
    if worst > POOR_FIT:
        note += f": another body than that of {person.source}, or markers elsewhere on it; measure both"
    return _result(person, motion, [note], person.settings.root(body), pressed)


def plate_load(plate: TrialPlate, link: str, time: FloatArray) -> Load:
    """Return the load of a force plate on the link that presses on it: the measured wrench with opposite sign.

    Args:
        plate: force plate of a c3d file.
        link: link of the body.
        time: time since the first frame, shape (n,) [s].
    """
    R, wrench = plate.T_lab_plate[:3, :3], -plate.loads(time)
    return Load(link, wrench[:, :3] @ R.T, wrench[:, 3:] @ R.T, np.tile(plate.T_lab_plate[:3, 3], (len(time), 1)))


def _result(
    person: Described,
    motion: Motion,
    notes: list[str],
    root: Pose | RootMotion,
    pressed: Sequence[Load] = (),
) -> Result:
    settings = person.settings.muscles
    anatomy = find(settings.anatomy, person.anatomy)
    loads = [*person.loads(motion.time), *pressed]
    found = load_of(person.body, anatomy, root, motion, loads, settings.strength, person.gravity)
    count = sum(found.is_muscle)
    notes.append(f"muscles: {anatomy.name}, {count} of them, strength {settings.strength:g}")
    notes.append(f"forces act on: {', '.join(load.link for load in loads) or 'none'}")
    for contact in (person.record.contacts if person.record is not None else {}).values():
        notes.append(
            f"NOT in it: contact of {contact.link}, {contact.force.max():.1f} N at most, whose direction no bag has"
        )
    for side, outside in found.outside.items():
        if outside.any():
            notes.append(
                f"{side} arm: outside the range that muscle paths were fitted in for {100 * outside.mean():.1f} % of "
                "the time, where its muscles are left out"
            )
    return Result(found, person.body, anatomy, tuple(notes))


def write(result: Result, folder: Path) -> list[Path]:
    """Write activation, force, joint torque and joint reactions as .sto files, overwriting any; return their paths.

    Raises:
        HricError: a file cannot be written.
    """
    load = result.load
    kinds = {
        "activation": (load.names, _known(load, load.names, load.activation), "1"),
        "force": (load.names, _known(load, load.names, load.force), "N of muscles, N m of actuators of a joint"),
        "torque": (load.joints, load.torque, "N m"),
        "strength_share": (load.joints, load.share, "1"),
        "shortfall": (load.joints, _known(load, load.joints, load.shortfall), "N m"),
    }
    paths = []
    for kind, (names, values, unit) in kinds.items():
        columns = dict(zip(names, values.T, strict=True))
        paths.append(_storage(folder, kind, load.time, columns, {"units": f"s; {unit}"}))
    columns = {}
    for joint, force in load.contact.items():
        for what, values in (("f", np.where(load.known(joint)[:, None], force, np.nan)), ("p", load.centres[joint])):
            in_ground = values @ R_YUP_ZUP.T
            columns |= {f"{joint}_on_distal_in_ground_{what}{axis}": in_ground[:, k] for k, axis in enumerate("xyz")}
    about = {"units": "s, N, m", "axes": GROUND}
    return [*paths, _storage(folder, "joint_reactions", load.time, columns, about)]


def _known(load: MuscleLoad, names: Sequence[str], values: FloatArray) -> FloatArray:
    """Return the values, shape (n, k), with NaN at times at which the muscle paths are unknown."""
    return np.where(np.stack([load.known(name) for name in names], axis=1), values, np.nan)


def _storage(folder: Path, kind: str, time: FloatArray, columns: dict[str, FloatArray], about: dict[str, str]) -> Path:
    path = folder / f"{kind}.sto"
    with atomic(path) as new:
        write_storage(new, time, columns, f"Muscle load: {kind}", about={**about, "estimate": "of a model"})
    return path


def render(result: Result, fatigue: bool = False) -> str:
    """Return the text tables: muscles in order of their peak activation, joints, and joint contact forces.

    Args:
        result: muscle load of a motion.
        fatigue: add the fatigued share of each muscle at the end (3CC-r, not reproduced).
    """
    load = result.load
    span = load.time[-1] - load.time[0]
    code = result.body.subject.code
    head = [f"muscle load of {code} over {span:.2f} s, a model's estimate", *result.notes]
    blocks = [_muscles(load, _fatigued(result) if fatigue else None), _joints(load), _contacts(load)]
    return "\n\n".join(["\n".join(head), *("\n".join(text.rows(cells, head=2)) for cells in blocks)]) + "\n"


def _muscles(load: MuscleLoad, fatigued: FloatArray | None) -> list[list[str]]:
    cells = [["muscle", "activation", "max", f"above {HIGH:g}", "force max"], ["", "mean, 1", "1", "% of time", "N"]]
    if fatigued is not None:
        cells = [[*cells[0], "fatigued at the end"], [*cells[1], "%, NOT REPRODUCED"]]
    for k in np.argsort(-load.activation.max(axis=0), kind="stable"):
        known = load.known(load.names[k])
        if load.is_muscle[k] and known.any():
            a, force = load.activation[known, k], load.force[known, k].max()
            row = [load.names[k], f"{a.mean():.3f}", f"{a.max():.3f}", f"{100 * (a > HIGH).mean():.0f}", f"{force:.0f}"]
            cells.append(row if fatigued is None else [*row, f"{100 * fatigued[k]:.2f}"])
    return cells


def _joints(load: MuscleLoad) -> list[list[str]]:
    cells = [
        ["joint", "torque max", "mean", "max", "shortfall max"],
        ["", "N m", "% of strength", "% of strength", "N m"],
    ]
    for j, name in enumerate(load.joints):
        measured, short = np.isfinite(load.torque[:, j]), np.abs(load.shortfall[load.known(name), j])
        share, torque = 100.0 * load.share[measured, j], np.abs(load.torque[measured, j])
        row = [f"{v:.1f}" for v in (torque.max(), share.mean(), share.max())] if len(share) else list("---")
        cells.append([name, *row, f"{short.max():.1f}" if len(short) else "-"])
    return cells


def _contacts(load: MuscleLoad) -> list[list[str]]:
    cells = [["joint contact force", "mean", "max"], ["", "N", "N"]]
    for name, force in load.contact.items():
        size = np.linalg.norm(force[load.known(name)], axis=1)
        cells.append([name, *([f"{size.mean():.0f}", f"{size.max():.0f}"] if len(size) else "--")])
    return cells


def _fatigued(result: Result) -> FloatArray:
    """Return the fatigued share of each muscle at the end of the motion, shape (k,) [1].

    The load of a muscle is its activation, or zero at the minimum of static optimisation. Muscles that cross the
    shoulder have the shoulder's fatigue parameters, all others the elbow's.
    """
    load, muscles = result.load, result.anatomy.muscles
    names = [name.partition("_")[2] for name in load.names]
    model = Fatigue(
        ["shoulder" if name in muscles and "shoulder" in muscles[name].pulls else "elbow" for name in names]
    )
    for activation, period in zip(load.activation, np.diff(load.time), strict=False):
        model.update(np.where(activation > MINIMUM, activation, 0.0), float(period))
    return model.fatigued


class MuscleLoadCommand(Command):
    """Estimate the muscle and joint load of a person's arms in a recorded motion.

    Activation and force of muscles, joint torque as share of strength, contact forces in shoulder and elbow, by
    inverse dynamics and static optimisation. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *run_arguments("or a c3d file with markers of the body (Plug-in Gait)", "RUN|FILE.c3d"),
            Argument(
                "--person",
                metavar="RUN|FILE.yaml",
                help="of a c3d file: who moves in it, from a run, whose grips load them too, or an experiment file",
            ),
            Argument(
                "--plate",
                action="append",
                default=[],
                metavar="N=LINK",
                help="of a c3d file: the link of the body that presses on its force plate N, as 1=r_wrist; may be "
                "repeated",
            ),
            Argument(
                "--tracked",
                action="store_true",
                help="of a run: the real person before its cameras (section person), tracked again from its frames",
            ),
            Argument(
                "--cutoff", type=float, default=CUTOFF, metavar="HZ", help=f"of the filter of joint angles ({CUTOFF:g})"
            ),
            *_muscles_arguments(),
            Argument("--output", type=Path, metavar="DIR", help=f"where to write (default: {FOLDER}/ of the run)"),
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Estimate the load, write its files, print its table."""
        recording, output = Path(given.run).expanduser(), given.output
        is_c3d = recording.suffix.lower() == ".c3d"
        if given.tracked and (is_c3d or given.cutoff != CUTOFF):
            raise MuscleLoadError(
                "--tracked is for a run, whose person is smoothed as they were live; valid: without --cutoff"
            )
        if is_c3d:
            result = _load_of_c3d(recording, given)
            output = output or recording.with_name(f"{recording.stem}_{FOLDER}")
        else:
            result = _load_of_run(given)
            output = output or RunFolder.open(given.run, given.runs).path / FOLDER
        output.mkdir(parents=True, exist_ok=True)
        names = ", ".join(path.name for path in write(result, output))
        print(f"{render(result, given.fatigue)}\nfiles for OpenSim: {output.absolute()}: {names}")


def _load_of_c3d(recording: Path, given: argparse.Namespace) -> Result:
    if given.person is None:
        raise MuscleLoadError(f"{recording.name} does not say whose markers it has; add --person RUN|EXPERIMENT.yaml")
    plates = dict(map(_plate, given.plate))
    person = described_by(given.person, given.runs).with_muscles(given.muscles, given.strength)
    return of_c3d(recording, person, given.cutoff, plates)


def _load_of_run(given: argparse.Namespace) -> Result:
    if given.person is not None or given.plate:
        raise MuscleLoadError("--person and --plate are for a c3d file; a run says who is in it, and what they hold")
    if given.tracked:
        return of_tracked(given.run, given.runs, _chosen(AS_SHIPPED, given.muscles, given.strength))
    person = described_by(given.run, given.runs).with_muscles(given.muscles, given.strength)
    return of_run(person, given.cutoff)


def _plate(given: str) -> tuple[int, str]:
    number, _, link = given.partition("=")
    if not number.isdecimal() or not link:
        raise MuscleLoadError(f"--plate is {given!r}; valid: N=LINK, as 1=r_wrist")
    return int(number), link


def _muscles_arguments() -> list[Argument]:
    return [
        Argument(
            "--muscles",
            metavar="FILE",
            help=f"their anatomy: {NAME}, built in; a .json file of fit_muscles; a model of a right arm, "
            ".osim or .xml of MuJoCo, which is fitted at its first use (default: as the person has it)",
        ),
        Argument("--strength", type=float, metavar="FACTOR", help="of the muscles (default: as the person has it)"),
        Argument(
            "--fatigue", action="store_true", help="add how far muscles are fatigued (3CC-r, which was NOT reproduced)"
        ),
    ]
