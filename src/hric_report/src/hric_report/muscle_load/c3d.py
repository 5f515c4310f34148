"""Muscle load of a motion that a c3d file contains as markers, with the force plates of the file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from hric_core.geometry import FloatArray, Pose
from hric_core.geometry.poses import inverse
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.trial.c3d import Trial, read_trial
from hric_core.trial.plates import TrialPlate
from hric_human.body.markers import check_upright, marker_labels
from hric_human.control import HumanControl
from hric_human.control.recorded import MarkerSolver
from hric_human.control.whole_body import ExternalLoad
from hric_human.muscles.after_run import CUTOFF, smoothed
from hric_motion.tracking.tracker import BRIDGE
from hric_motion.trial import without_strays
from hric_report.muscle_load.motions import MuscleLoadResult, computed
from hric_report.muscle_load.person import DescribedPerson, MuscleLoadError

NO_PLATES: Mapping[int, str] = MappingProxyType({})
POOR_FIT, WORST_FIT = 0.015, 0.05
"""Distance of the markers from the body model (RMS over the markers, median over the frames) [m]: above the first value
a note says that the markers may belong to another person; above the second, the file is rejected. Project default."""


def of_c3d(
    path: Path,
    person: DescribedPerson,
    cutoff: float = CUTOFF,
    plates: Mapping[int, str] = NO_PLATES,
) -> MuscleLoadResult:
    """Compute the muscle load from the markers of a c3d file, whose laboratory frame is taken as the world frame.

    Times of the file are taken as times of the person's run; without a start time in the file they begin with the run.

    Args:
        path: c3d file.
        person: person with the markers, and the grips recorded in their run.
        cutoff: cut-off frequency of the filter for joint angles [Hz].
        plates: links of the body that press on the force plates of the file, by plate number from 1 on.

    Raises:
        HricError: the file cannot be read, has no markers of the body, or markers that do not fit the body; or a force
            plate or link does not exist.
    """
    trial, body = read_trial(path), person.body
    labels = marker_labels(path.name, trial.labels, tuple(body.markers))
    trial = without_strays(trial, labels)
    names = list(labels)
    positions = _positions(trial, labels, inverse(person.settings.root(body)))
    seen = np.asarray(np.isfinite(positions).all(axis=2)).any(axis=1)
    if not seen.any():
        raise MuscleLoadError(f"{path.name} has no frame with a marker of the body")
    first, last = np.flatnonzero(seen)[[0, -1]]
    rows, distance = MarkerSolver(HumanControl(body, {}, 0).person, names).solve(positions[first : last + 1])
    worst = float(np.median(distance))
    if worst > WORST_FIT:
        raise MuscleLoadError(
            f"the markers of {path.name} are {1e3 * worst:.0f} mm from those of {person.source} (median over the "
            f"frames); valid: up to {1e3 * WORST_FIT:.0f} mm, in the same laboratory, of the same person"
        )
    motion = smoothed(trial.start + np.arange(first, last + 1) / trial.rate, np.array(rows), cutoff)
    pressed = [plate_load(trial.plate(number), link, motion.time - trial.start) for number, link in plates.items()]
    note = f"motion: {len(names)} markers of {path.name}, {1e3 * worst:.1f} mm from those of the body (median)"
    if worst > POOR_FIT:
        note += f": this is not the body of {person.source}, or the markers are placed differently; measure both"
    notes = [note, *_lost(positions[first : last + 1], names, trial.rate)]
    notes += [f"left out of {path.name}: {reason}" for reason in trial.left_out]
    return computed(person, motion, notes, person.settings.root(body), pressed)


def _lost(positions: FloatArray, names: Sequence[str], rate: float) -> list[str]:
    """Return a note on markers that are not visible for longer than BRIDGE at a time; empty: there are none."""
    seen, lost = np.asarray(np.isfinite(positions).all(axis=2)), list[str]()
    for name, visible in zip(names, seen.T, strict=True):
        longest = np.diff(np.flatnonzero(np.concatenate([[True], visible, [True]]))).max() - 1
        if longest > BRIDGE * rate:
            lost.append(f"{name} {longest / rate:.2f} s")
    return (
        [f"NOT KNOWN: the motion is interpolated where markers are lost; longest gaps: {', '.join(lost)}"]
        if lost
        else []
    )


def _positions(trial: Trial, labels: Mapping[str, str], T_root_world: Pose) -> FloatArray:
    """Return marker positions in axes of the root link, shape (frames, markers, 3) [m]; `labels`: by marker name."""
    p_lab = trial.markers(list(labels.values()))
    if not trial.up_known:
        check_upright(trial.name, dict(zip(labels, p_lab.swapaxes(0, 1), strict=True)))
    R = rotation_from_quaternion(T_root_world.orientation)
    return np.asarray(p_lab @ R.T + np.array(T_root_world.position))


def plate_load(plate: TrialPlate, link: str, time: FloatArray) -> ExternalLoad:
    """Return the external load of a force plate on the body link that presses on it: the negative measured wrench.

    Args:
        plate: force plate of a c3d file.
        link: link of the body.
        time: time since the first frame, shape (n,) [s].
    """
    R, wrench = plate.T_lab_plate[:3, :3], -plate.loads(time)
    return ExternalLoad(
        link, wrench[:, :3] @ R.T, wrench[:, 3:] @ R.T, np.tile(plate.T_lab_plate[:3, 3], (len(time), 1))
    )
