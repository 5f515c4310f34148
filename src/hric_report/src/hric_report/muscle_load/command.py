"""Command `muscle_load`: writes a text table, and .sto files for OpenSim in the axes of OpenSim's ground frame."""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hric_assessment.ergonomics.fatigue import Fatigue
from hric_bags import text
from hric_bags.arguments import run_arguments
from hric_bags.export.opensim_text import GROUND, write_storage
from hric_bags.files import atomic
from hric_bags.run_folder import RunFolder
from hric_core.command import Argument, Command
from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import R_YUP_ZUP
from hric_human.muscles.after_run import CUTOFF, MuscleLoad
from hric_human.muscles.choose import NAME
from hric_human.muscles.static_optimization import MINIMUM
from hric_report.muscle_load.c3d import of_c3d
from hric_report.muscle_load.motions import AS_SHIPPED, MuscleLoadResult, of_run, of_tracked
from hric_report.muscle_load.person import MuscleLoadError, choose, described_by

FOLDER = "muscle_load"
HIGH = 0.3
"""Activation above which a muscle counts as highly active [1]; project default."""


def write(result: MuscleLoadResult, folder: Path) -> list[Path]:
    """Write activations, forces, joint torques and joint reactions as .sto files, overwriting any; return their paths.

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
    """Return the values, shape (n, k), with NaN where the muscle paths are not known."""
    return np.where(np.stack([load.known(name) for name in names], axis=1), values, np.nan)


def _storage(folder: Path, kind: str, time: FloatArray, columns: dict[str, FloatArray], about: dict[str, str]) -> Path:
    path = folder / f"{kind}.sto"
    with atomic(path) as new:
        write_storage(new, time, columns, f"Muscle load: {kind}", about={**about, "estimate": "of a model"})
    return path


def render(result: MuscleLoadResult, fatigue: bool = False) -> str:
    """Return the text tables: muscles in order of their peak activation, joints, and joint contact forces.

    Args:
        result: muscle load of a motion.
        fatigue: True to add the fatigued share of each muscle at the end (3CC-r; published values not reproduced).
    """
    load = result.load
    span = load.time[-1] - load.time[0]
    code = result.body.subject.code
    head = [f"muscle load of {code} over {span:.2f} s (model estimate)", *result.notes]
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


def _fatigued(result: MuscleLoadResult) -> FloatArray:
    """Return the fatigued share of each muscle at the end of the motion, shape (k,) [1].

    The load of a muscle is its activation, or zero at the lower bound of static optimisation. Muscles that cross the
    shoulder use the fatigue parameters of the shoulder, all others those of the elbow.
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
        """Return the command-line arguments."""
        return [
            *run_arguments("or a c3d file with markers of the body (Plug-in Gait)", "RUN|FILE.c3d"),
            Argument(
                "--person",
                metavar="RUN|FILE.yaml",
                help="for a c3d file: the person, as defined in a run (with its recorded grip forces) or an "
                "experiment file",
            ),
            Argument(
                "--plate",
                action="append",
                default=[],
                metavar="N=LINK",
                help="for a c3d file: link of the body that presses on its force plate N, for example 1=r_wrist; may "
                "be repeated",
            ),
            Argument(
                "--tracked",
                action="store_true",
                help="for a run: use the real person in front of the cameras (section person), tracked again from the "
                "recorded frames",
            ),
            Argument(
                "--cutoff",
                type=float,
                default=CUTOFF,
                metavar="HZ",
                help=f"cut-off frequency of the filter for joint angles [Hz] (default: {CUTOFF:g})",
            ),
            *_muscles_arguments(),
            Argument("--output", type=Path, metavar="DIR", help=f"output folder (default: {FOLDER}/ of the run)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Estimate the muscle and joint load, write the .sto files, and print the tables."""
        recording, output = Path(arguments.run).expanduser(), arguments.output
        is_c3d = recording.suffix.lower() == ".c3d"
        if arguments.tracked and (is_c3d or arguments.cutoff != CUTOFF):
            raise MuscleLoadError("--tracked uses the filter of the live run; valid: with a run, and without --cutoff")
        if is_c3d:
            result = _load_of_c3d(recording, arguments)
            output = output or recording.with_name(f"{recording.stem}_{FOLDER}")
        else:
            result = _load_of_run(arguments)
            output = output or RunFolder.open(arguments.run, arguments.runs).path / FOLDER
        output.mkdir(parents=True, exist_ok=True)
        names = ", ".join(path.name for path in write(result, output))
        print(f"{render(result, arguments.fatigue)}\nfiles for OpenSim: {output.absolute()}: {names}")


def _load_of_c3d(recording: Path, arguments: argparse.Namespace) -> MuscleLoadResult:
    if arguments.person is None:
        raise MuscleLoadError(f"the person of {recording.name} is not known; add --person RUN|EXPERIMENT.yaml")
    plates = dict(map(_plate, arguments.plate))
    person = described_by(arguments.person, arguments.runs).with_muscles(arguments.muscles, arguments.strength)
    return of_c3d(recording, person, arguments.cutoff, plates)


def _load_of_run(arguments: argparse.Namespace) -> MuscleLoadResult:
    if arguments.person is not None or arguments.plate:
        raise MuscleLoadError("--person and --plate are for a c3d file; a run already defines the person and the grips")
    if arguments.tracked:
        return of_tracked(arguments.run, arguments.runs, choose(AS_SHIPPED, arguments.muscles, arguments.strength))
    person = described_by(arguments.run, arguments.runs).with_muscles(arguments.muscles, arguments.strength)
    return of_run(person, arguments.cutoff)


def _plate(text: str) -> tuple[int, str]:
    number, _, link = text.partition("=")
    if not number.isdecimal() or not link:
        raise MuscleLoadError(f"--plate is {text!r}; valid: N=LINK, such as 1=r_wrist")
    return int(number), link


def _muscles_arguments() -> list[Argument]:
    return [
        Argument(
            "--muscles",
            metavar="FILE",
            help=f"muscle anatomy: {NAME} (built in); a .json file that fit_muscles wrote; or a model of a right arm "
            "as "
            ".osim or MuJoCo .xml, which is fitted at its first use (default: the anatomy of the person)",
        ),
        Argument(
            "--strength",
            type=float,
            metavar="FACTOR",
            help="strength factor of the muscles (default: the factor of the person)",
        ),
        Argument(
            "--fatigue",
            action="store_true",
            help="add the fatigue of each muscle (model 3CC-r, whose published values were NOT reproduced)",
        ),
    ]
