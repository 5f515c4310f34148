"""Command `muscle_load`: what a recorded motion cost the arms of the person in it.

From the joint states and the grips of a run, or from the markers of a c3d file, by `hric_human.muscles.after_run`; a
table for people, and .sto files that OpenSim opens, in the axes of its ground.
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
"""Root mean square distance of markers from those of the body, above which they may not be his, and are not [m];
project default."""


class MuscleLoadError(HricError):
    """A recording that has not what muscle load needs."""


@dataclass(frozen=True)
class Described:
    """Who moved, and what acted on him.

    Attributes:
        settings: where he is.
        body: his.
        gravity: in the world [m/s^2].
        record: from a run's bag; None: of an experiment file, from which nothing acts on him.
        source: what described him, for people.
        anatomy: what names the anatomy of his muscles, for messages.
    """

    settings: HumanSettings
    body: Body
    gravity: Vector
    record: HumanRecord | None
    source: str
    anatomy: str = "human.muscles.anatomy"

    def with_muscles(self, anatomy: str | None, strength: float | None) -> "Described":
        """The same person with another anatomy, or another factor of the strength of his muscles; None: his own."""
        muscles = _chosen(self.settings.muscles, anatomy, strength)
        where = self.anatomy if anatomy is None else "--muscles"
        return replace(self, settings=replace(self.settings, muscles=muscles), anatomy=where)

    def loads(self, time: FloatArray) -> list[Load]:
        """What his grips do to his links, shape (n,) of instants [s]."""
        return [] if self.record is None else grip_loads(self.record.grips.values(), time)


def _chosen(own: MuscleSettings, anatomy: str | None, strength: float | None) -> MuscleSettings:
    """With what is given instead."""
    return replace(own, anatomy=anatomy or own.anatomy, strength=own.strength if strength is None else strength)


@dataclass(frozen=True)
class Result:
    """What came of it.

    Attributes:
        load: of the muscles.
        body: whose.
        anatomy: of the muscles.
        notes: for people: how the motion was found, and what is not in it.
    """

    load: MuscleLoad
    body: Body
    anatomy: Anatomy
    notes: tuple[str, ...]


def described_by(given: str, root: Path | None = None) -> Described:
    """A person, from a run or from an experiment file.

    Args:
        given: a run folder, its name, "latest", or the path of a YAML file.
        root: folder of all runs.

    Raises:
        HricError: there is none, or nobody is in it.
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
            f"the bag of {folder.path.name} has no motion of its human; muscle load needs his joint_states beside his "
            "joint torque (hric/human/joint_states, hric/human/joint_torque)"
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
    """Of the motion that a run recorded.

    Args:
        person: of the run.
        cutoff: of the low-pass filter of angles [Hz].

    Raises:
        HricError: no record of a motion, too short a motion, a body without arms.
    """
    record = person.record
    if record is None:
        raise MuscleLoadError(f"{person.source} describes somebody, and has no motion; valid: a run, or a c3d file")
    motion, root = motion_of(record, list(person.body.joints), person.settings.root(person.body), cutoff)
    result = _result(person, motion, [f"motion: joint states of {person.source}"], root)
    return replace(result, notes=(*result.notes, _against(result.load, record)))


def _against(load: MuscleLoad, record: HumanRecord) -> str:
    """How far inverse dynamics is from the joint torque that the run logged."""
    inside = (load.time >= record.torque_time[0]) & (load.time <= record.torque_time[-1])
    columns = [
        np.interp(load.time[inside], record.torque_time, record.torque[:, record.joints.index(name)])
        for name in load.joints
    ]
    error = np.sqrt(np.mean((load.torque[inside] - np.transpose(columns)) ** 2))
    return f"joint torque is {error:.3f} N m RMS from what the run logged"


def of_tracked(given: str, root: Path | None = None, muscles: MuscleSettings = AS_SHIPPED) -> Result:
    """Of the real person before the cameras of a run, tracked again from its frames.

    Args:
        given: a run folder, its name, or "latest".
        root: folder of all runs.
        muscles: their anatomy and strength.

    Raises:
        HricError: the run has no section `person`, or its bag does not show him.
    """
    folder = RunFolder.open(given, root)
    run = folder.read()
    section = (run.get("definition") or {}).get("person")
    if section is None:
        raise MuscleLoadError(f"{folder.path.name} tracked nobody; valid: a run of an experiment with a section person")
    anatomy = find(muscles.anatomy, "--muscles")
    with bag_reader.opened(bag_of(folder, run)) as reader:
        settings = PersonSettings.of(section, "person")
        of_him = tracked_person.tracked(reader, bag_reader.read(reader).robot_time, settings, anatomy, muscles.strength)
    return Result(of_him.found.load, of_him.body, anatomy, of_him.notes)


def of_c3d(
    path: Path,
    person: Described,
    cutoff: float = CUTOFF,
    plates: Mapping[int, str] = NO_PLATES,
) -> Result:
    """Of the markers in a c3d file. Its laboratory is the person's world, and the begin of its clock, if the file has
    none, that of the run.

    Args:
        path: of the file.
        person, cutoff: see `of_run`.
        plates: links of the body that press on force plates of the file, by the plates' numbers from 1 on.

    Raises:
        HricError: no such file, no markers of the body in it, or they are elsewhere; no such plate or link.
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
    """What a force plate does to the link that presses on it: the opposite of what it measures.

    Args:
        plate: of a c3d file.
        link: of the body.
        time: since the first frame, shape (n,) [s].
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
    """Write activation, force, joint torque and joint reactions as .sto files, replacing those that are there; returns
    their paths. Raises HricError where they cannot be written."""
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
    """Values by name, NaN where muscle paths are not known."""
    return np.where(np.stack([load.known(name) for name in names], axis=1), values, np.nan)


def _storage(folder: Path, kind: str, time: FloatArray, columns: dict[str, FloatArray], about: dict[str, str]) -> Path:
    path = folder / f"{kind}.sto"
    with atomic(path) as new:
        write_storage(new, time, columns, f"Muscle load: {kind}", about={**about, "estimate": "of a model"})
    return path


def render(result: Result, fatigue: bool = False) -> str:
    """As text: muscles by their largest activation, joints, joint centres.

    Args:
        result: what came of it.
        fatigue: whether to add how much of each muscle is fatigued at the end (3CC-r, not reproduced).
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
    """Share of each muscle that is fatigued at the end, shape (k,) [1]; its load is its activation, of one that is
    least active zero. What crosses the shoulder tires as the shoulder, all others as the elbow."""
    load, muscles = result.load, result.anatomy.muscles
    names = [name.partition("_")[2] for name in load.names]
    model = Fatigue(
        ["shoulder" if name in muscles and "shoulder" in muscles[name].pulls else "elbow" for name in names]
    )
    for activation, period in zip(load.activation, np.diff(load.time), strict=False):
        model.update(np.where(activation > MINIMUM, activation, 0.0), float(period))
    return model.fatigued


class MuscleLoadCommand(Command):
    """Estimate what a recorded motion cost the arms of the person in it: activation and force of muscles, joint torque
    as share of strength, contact forces in shoulder and elbow, by inverse dynamics and static optimisation. Needs no
    ROS master."""

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *run_arguments("or a c3d file with markers of the body (Plug-in Gait)", "RUN|FILE.c3d"),
            Argument(
                "--person",
                metavar="RUN|FILE.yaml",
                help="of a c3d file: who moves in it, from a run, whose grips load the person too, or an experiment "
                "file",
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
