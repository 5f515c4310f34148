"""Motion of a person from the files of a laboratory: markers by their labels, subject, vertical axis, and fit.

result = trial_motion(Path("walk.c3d"), static=Path("static.c3d"))
result.motion.q, result.motion.spread     # joint angles and their standard deviations [rad]
result.notes                              # what was assumed, and what was left out
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from hric_core.errors import HricError, ParameterError
from hric_core.geometry import UP_AXES, FloatArray
from hric_core.trial.c3d import Trial, read_trial
from hric_human.body import Subject, load
from hric_human.body.markers import check_upright, markers
from hric_human.body.segments import LINKS, segments
from hric_human.participant.settings import SUBJECTS
from hric_motion.fit import TRUNK, Progress, seen_in
from hric_motion.formats import FORMATS, read_motive, read_mvnx, read_trc
from hric_motion.handovers import is_handover, read_handover
from hric_motion.marker_sets import FEW, Person, TrialMarkerSet, best_set, mapped_set
from hric_motion.measured import MeasuredMotion, measured

MIN_MARKERS, MIN_TRUNK = 10, 3
"""Smallest numbers of markers of a known set, in all and on the trunk (project default, unconfirmed)."""
FARTHEST = 2.5
"""Largest distance of a marker from the median of a person's markers [m] (project default, unconfirmed)."""
LEGS = tuple(f"_{LINKS[kind]}" for kind in ("thigh", "shank", "foot"))
"""Endings of the links of a leg."""
DEFAULT = "P50_male"
"""Subject whose measures are taken where neither options nor files state them."""
MEASURES = ("mass", "height", "sex")
UNITS = {"mass": " kg", "height": " m", "sex": ""}
NO_MEASURES: Mapping[str, float | str] = MappingProxyType({})


@dataclass(frozen=True)
class TrialMotion:
    """Motion of one person in a trial.

    Attributes:
        motion: motion, and the body that was fitted.
        trial: content of the file, its markers rotated to z up.
        labels: label of each marker in the file.
        marker_set: name of the marker set, or of the mapping file.
        prefix: prefix of the person's labels.
        subject: subject of the table of lengths with which the fit began.
        sources: where mass, height and sex of the subject come from.
        notes: what was assumed, and what was left out, one sentence each.
    """

    motion: MeasuredMotion
    trial: Trial
    labels: Mapping[str, str]
    marker_set: str
    prefix: str
    subject: Subject
    sources: Mapping[str, str]
    notes: tuple[str, ...]

    @property
    def time(self) -> FloatArray:
        """Times of the frames, shape (n,) [s]."""
        return self.trial.start + np.arange(len(self.motion.q)) / self.trial.rate

    @property
    def positions(self) -> FloatArray:
        """Positions of the markers of the motion, shape (n, m, 3) [m]; NaN: not visible, or not in this file."""
        return _positions(self.trial, dict(self.labels), self.motion.names)


@dataclass(frozen=True)
class _Worn:
    """Markers of one person: marker set, prefix of the labels, and label of each marker."""

    chosen: TrialMarkerSet
    prefix: str
    labels: Person


def read(path: Path, up: str = "") -> Trial:
    """Read the markers of a trial.

    Args:
        path: path of a .c3d, .xdf, .trc, .csv (Motive) or .mvnx (Xsens) file, or of the folder of a handover.
        up: vertical axis in the file, y or z; empty: as the file states, or as is usual for its format.

    Raises:
        HricError: the file cannot be read, or its content is not in this format.
    """
    readers = {".c3d": read_trial, ".xdf": read_trial, ".trc": read_trc, ".csv": read_motive, ".mvnx": read_mvnx}
    reader = read_handover if is_handover(path) else readers.get(path.suffix.lower())
    if reader is None:
        raise ParameterError(
            f"{path} is not a trial; valid: a {', '.join(FORMATS[:-1])} or {FORMATS[-1]} file, or a handover's folder"
        )
    if up and up not in UP_AXES:
        raise ParameterError(f"the axis that points up in {path.name} is {up!r}; valid: {', '.join(UP_AXES)}")
    return reader(path, up)


def prefixes(path: Path) -> tuple[str, ...]:
    """Return the prefixes of the people in a file, who have at least FEW markers of a known set each."""
    trial = read(path)
    return tuple(_people(best_set(trial.labels), trial.labels))


def trial_motion(
    path: Path,
    static: Path | None = None,
    subject: Subject | None = None,
    up: str = "",
    prefix: str | None = None,
    labels: Path | None = None,
    measures: Mapping[str, float | str] = NO_MEASURES,
    progress: Progress = lambda done, total: None,
) -> TrialMotion:
    """Return the motion of one person in a file.

    Args:
        path: file with the motion, see `read`.
        static: static trial of the same person; the body is fitted to frames of both files.
        subject: subject; None: `measures`, what the files state, and the 50th percentile, in this order.
        up: vertical axis in the files, y or z; empty: as they state, or as is usual for their format.
        prefix: prefix of the person's labels, with or without the separator at its end; None: there is one person.
        labels: mapping file, see `marker_sets.mapped_set`; None: the labels are those of a known marker set.
        measures: some of the subject's mass [kg], height [m] and sex.
        progress: called with the number of frames that are done, and that of all.

    Raises:
        HricError: a file cannot be read, its marker set is unknown, it has several people, or the body does not fit.
    """
    trials = [read(file, up) for file in (path, static) if file is not None]
    worn = _mapped(trials[0], labels) if labels is not None else _worn(trials[0], prefix)
    person, sources = (subject, dict.fromkeys(MEASURES, "the subject's file")) if subject else _of(trials, measures)
    extra = tuple(worn.chosen.extra.values())
    on = {one.name: one.link for one in markers(segments(replace(person, parts="whole_body")), extra)}
    _check_known(trials[0], worn, [name for name in worn.labels if on[name] in TRUNK], mapped=labels is not None)
    by_trial = [worn.labels, *(_again(trial, worn, labels is not None) for trial in trials[1:])]
    trials = list(map(without_strays, trials, by_trial))
    names, never, positions = _seen(trials, by_trial)
    _check_upright(trials, names, positions)
    legs = any(on[name].endswith(LEGS) for name in names)
    person = replace(person, parts="whole_body" if legs else "upper_body")
    try:
        still = positions[1] if static else None
        motion = measured(person, names, positions[0], trials[0].rate, extra, still, progress)
    except HricError as error:
        raise HricError(f"{path.name}: {error}") from error
    about = worn.chosen.name, worn.prefix.strip(":_/"), person, sources, _notes(trials, worn, sources, person, never)
    return TrialMotion(motion, trials[0], worn.labels, *about)


def _mapped(trial: Trial, path: Path) -> _Worn:
    """Return the markers that a mapping file names. Raises ParameterError: the trial has none of its labels."""
    chosen, named = mapped_set(path)
    found = {name: label for name, label in named.items() if label in trial.labels}
    if not found:
        raise ParameterError(
            f"{trial.name} has no label that {path} maps to a marker; it has {', '.join(trial.labels)}"
        )
    return _Worn(chosen, "", found)


def _worn(trial: Trial, prefix: str | None) -> _Worn:
    """Return the markers of a person. Raises ParameterError: there are several people, or no such one."""
    if not trial.labels:
        raise ParameterError(f"{trial.name} has no markers")
    chosen = best_set(trial.labels)
    people = _people(chosen, trial.labels)
    several = ", ".join(f"{key!r} ({len(found)} markers)" for key, found in people.items()) or "none"
    if prefix is not None:
        matching = {key: found for key, found in people.items() if key.strip(":_/") == prefix.strip(":_/")}
        if not matching:
            raise ParameterError(f"{trial.name} has no markers with the prefix {prefix!r}; valid: {several}")
        people = matching
    if len(people) > 1:
        raise ParameterError(
            f"{trial.name} has markers of {len(people)} people; give the prefix of one, or all; valid: {several}"
        )
    return _Worn(chosen, *people.popitem()) if people else _Worn(chosen, "", {})


def _people(chosen: TrialMarkerSet, labels: Iterable[str]) -> dict[str, Person]:
    """Return the labels of the markers by prefix; one with fewer than FEW is left out if others have more."""
    people = chosen.people(labels)
    return {key: found for key, found in people.items() if len(found) >= FEW} or people


def _again(trial: Trial, worn: _Worn, mapped: bool) -> Person:
    """Return the labels of the person's markers in another file. Raises ParameterError: it has several people."""
    if mapped:
        return {name: label for name, label in worn.labels.items() if label in trial.labels}
    people = _people(worn.chosen, trial.labels)
    if worn.prefix in people or len(people) == 1:
        return people.get(worn.prefix) or people.popitem()[1]
    several = ", ".join(map(repr, people)) or f"a file with markers of {worn.chosen.name}"
    raise ParameterError(f"{trial.name} has no markers with the prefix {worn.prefix!r}; valid: {several}")


def _seen(trials: Sequence[Trial], labels: Sequence[Person]) -> tuple[tuple[str, ...], list[str], list[FloatArray]]:
    """Return the markers that are visible in any trial, those that never are, and the positions of the former [m]."""
    names = tuple(dict.fromkeys(name for one in labels for name in one))
    positions = [_positions(trial, one, names) for trial, one in zip(trials, labels, strict=True)]
    visible = np.any([seen_in(p).any(axis=0) for p in positions], axis=0)
    never = [name for name, seen in zip(names, visible, strict=True) if not seen]
    return tuple(name for name in names if name not in never), never, [p[:, visible] for p in positions]


def _positions(trial: Trial, labels: Person, names: Sequence[str]) -> FloatArray:
    """Return the positions of markers, shape (n, m, 3) [m]; NaN: not visible, or not in this file."""
    positions = np.full((len(trial.positions), len(names), 3), np.nan)
    for column, name in enumerate(names):
        if name in labels:
            positions[:, column] = trial.positions[:, trial.labels.index(labels[name])]
    return positions


def without_strays(trial: Trial, labels: Person) -> Trial:
    """Return a trial in which markers farther than FARTHEST from the median of the person's markers are not visible.

    Frames in which at least half of the markers are that far away are unchanged: their unit may be wrong.
    """
    rows, positions = [trial.labels.index(label) for label in labels.values()], trial.positions.copy()
    p, seen = positions[:, rows], seen_in(positions[:, rows])
    middle = [np.median(frame[k] if k.any() else frame, axis=0) for frame, k in zip(p, seen, strict=True)]
    strays = seen & (np.linalg.norm(p - np.reshape(middle, (-1, 1, 3)), axis=2) > FARTHEST)
    strays &= (2 * strays.sum(axis=1) < seen.sum(axis=1))[:, None]
    counts = {trial.labels[row]: count for row, count in zip(rows, strays.sum(axis=0), strict=True) if count}
    if not counts:
        return trial
    positions[:, rows] = np.where(strays[..., None], np.nan, p)
    named = ", ".join(f"{label} in {count} of {len(strays)} frames" for label, count in counts.items())
    sentence = f"markers more than {FARTHEST:g} m from the median of the person's markers: {named}"
    return replace(trial, positions=positions, reasons={**trial.reasons, "strays": sentence})


def _check_known(trial: Trial, worn: _Worn, trunk: Sequence[str], *, mapped: bool) -> None:
    """Check that enough markers are known. Raises ParameterError."""
    names = worn.labels
    if (len(names) >= MIN_MARKERS or mapped) and len(trunk) >= MIN_TRUNK:
        return
    raise ParameterError(
        f"{trial.name} has no known marker set: {worn.chosen.name} is the nearest, with {len(names)} of "
        f"{len(trial.labels)} labels ({', '.join(names) or 'none'}), {len(trunk)} of them on the trunk; valid: "
        f"{MIN_MARKERS} or more, {MIN_TRUNK} on the trunk. Map its labels to markers: "
        f"hric trial {trial.name} --labels NEW.yaml"
    )


def _check_upright(trials: Sequence[Trial], names: Sequence[str], positions: Sequence[FloatArray]) -> None:
    """Check the vertical axis of files that do not state it. Raises ParameterError."""
    for trial, p in zip(trials, positions, strict=True):
        if not trial.up_known:
            check_upright(trial.name, dict(zip(names, p.swapaxes(0, 1), strict=True)), trial.up)


def _of(trials: Sequence[Trial], measures: Mapping[str, float | str]) -> tuple[Subject, dict[str, str]]:
    """Return the subject from options, files and the default, and where each measure comes from."""
    default = load(SUBJECTS / f"{DEFAULT}.yaml")
    values, sources = dict[str, float | str](), dict[str, str]()
    for key in MEASURES:
        stated = next((trial for trial in trials if key in trial.subject), None)
        if key in measures:
            values[key], sources[key] = measures[key], "option"
        elif stated is not None:
            values[key], sources[key] = stated.subject[key], stated.name
        else:
            values[key], sources[key] = getattr(default, key), DEFAULT
    return Subject.of({"code": "S1", **values}, "subject:"), sources


def _notes(
    trials: Sequence[Trial], worn: _Worn, sources: Mapping[str, str], person: Subject, never: Sequence[str]
) -> tuple[str, ...]:
    """Return what was assumed, and what was left out."""
    trial, people = trials[0], _people(worn.chosen, trials[0].labels)
    used = {label for labels in (worn.labels, *people.values()) for label in labels.values()}
    assumed = [f"{key} {getattr(person, key)}{UNITS[key]}" for key in MEASURES if sources.get(key) == DEFAULT]
    notes = [f"assumed: {', '.join(assumed)}, of {DEFAULT}, as no option and no file states it"] if assumed else []
    notes += [
        f"assumed: {one.up} points up in {one.name}, which does not state it" for one in trials if not one.up_known
    ]
    notes += worn.chosen.left_out(label for label in trial.labels if label not in used)
    notes += [f"markers that are never visible: {', '.join(never)}"] if never else []
    return (*notes, *(f"left out of {one.name}: {sentence}" for one in trials for sentence in one.left_out))
