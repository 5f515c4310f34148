"""Figures about the load of a person's joints and muscles; they have no limits, since the strength is a model's."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hric_assessment.ergonomics.muscle_load import grip_loads, load_of, motion_of
from hric_assessment.findings import UnjudgedValue
from hric_assessment.tables import verdict_table
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.result import ActivationCurve, thinned
from hric_bags.records.human_record import HumanRecord
from hric_bags.records.recording import Columns
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose
from hric_human.body.joints import in_words
from hric_human.control.whole_body import RootMotion
from hric_human.muscles.after_run import CUTOFF, MuscleLoad, RecordedMotion
from hric_human.muscles.anatomy import Anatomy
from hric_human.muscles.choose import find

RATE = 20.0
"""Rate of the instants at which the muscle load is computed, independently of each other [Hz]."""
PIECE, OVERLAP = 60.0, 1.0
"""Length of the pieces in which a long motion is processed, and overlap that is discarded at both ends [s]."""
MODEL = "a model's estimate"


@dataclass(frozen=True)
class Loads:
    """Load of one person's joints and muscles.

    Attributes:
        figures: values without a limit, sorted by group.
        activation: muscle activation over time; None: not known.
    """

    figures: tuple[UnjudgedValue, ...]
    activation: Columns | None

    def timeline(self) -> ActivationCurve | None:
        """Return the muscle activation over time as a curve of the verdict; None: not known."""
        if self.activation is None:
            return None
        rows = thinned(self.activation.time, np.nan_to_num(self.activation.values).max(axis=1))
        columns = self.activation.values[rows].T.tolist()
        return ActivationCurve(self.activation.names, self.activation.time[rows].tolist(), columns)


def loads(source: AssessmentInput, person: AssessedPerson | None, *, muscles: bool = True) -> Loads:
    """Return joint torque as share of strength, muscle activation, and joint contact force, as far as they are known.

    Args:
        source: recording with the files next to it.
        person: assessed person; None: there is none, and all signals of the recording count.
        muscles: True to compute the load of muscles that was not recorded, which takes most of the time.
    """
    figures = _strength(source, person)
    recorded = next(_of_person(source.recording.activation, person), None)
    contacts = list(_of_person(source.recording.contact, person))
    computed, shown = _computed(person) if muscles else None, recorded
    if recorded is not None:
        spanned = _muscles_of(recorded, computed[0].names) if computed else recorded
        figures += _active(spanned, f"recorded, {MODEL}")
    if computed:
        modelled, weak, contact = computed
        if recorded is None:
            shown = modelled
            figures += _active(modelled, f"as modelled, by static optimisation, {MODEL}")
        factor = verdict_table()["weak_shoulder"]
        figures += _active(weak, f"with {factor:g} times the strength of all muscles, {MODEL}", brief=True)
        figures += [] if contacts else _contact(contact, "computed")
    for columns in contacts:
        figures += _contact(dict(zip(columns.names, columns.values.T, strict=True)), "recorded")
    return Loads(tuple(figures), shown)


def _of_person(streams: Mapping[str, Columns], person: AssessedPerson | None) -> Iterator[Columns]:
    """Yield the streams in the namespace of a person."""
    for topic, columns in streams.items():
        if person is None or not person.name or topic.startswith(f"{person.name}/"):
            yield columns


def _muscles_of(recorded: Columns, muscles: Sequence[str]) -> Columns:
    """Return the recorded activation of the given muscles only."""
    rows = [k for k, name in enumerate(recorded.names) if name in muscles]
    names = tuple(recorded.names[k] for k in rows)
    return Columns(recorded.topic, names, recorded.time, recorded.values[:, rows])


def _strength(source: AssessmentInput, person: AssessedPerson | None) -> list[UnjudgedValue]:
    """Return the largest torque of each joint as share of its strength; for shoulders also for a weaker person."""
    record, table = None if person is None else person.record, verdict_table()
    left_out: FloatArray | float = 0.0
    columns = next(_of_person(source.recording.shares, person), None)
    if record is not None and len(record.torque_time):
        names, shares, left_out = record.joints, np.abs(record.share), record.share_left_out
    elif columns is not None:
        names, shares = columns.names, np.abs(columns.values)
    else:
        return []
    figures, factor = [], table["weak_shoulder"]
    peaks = np.fmax(np.fmax.reduce(shares), left_out)
    for name, share, largest in zip(names, shares.T, peaks.tolist(), strict=True):
        if not np.isfinite(share).any():
            continue
        mean = float(np.nanmean(share))
        note = f"mean {mean:.3g}; {MODEL}"
        figures.append(
            UnjudgedValue("strength", f"largest torque of {in_words(name)} over its strength", largest, "1", note)
        )
        if "_sh_" in name:
            note = f"mean {mean / factor:.3g}; with {factor:g} times the modelled strength of the shoulder"
            label = f"largest torque of {in_words(name)}, weaker shoulder"
            figures.append(UnjudgedValue("strength", label, largest / factor, "1", note))
    return sorted(figures, key=lambda figure: -(figure.value or 0.0))


def _active(columns: Columns, note: str, brief: bool = False) -> list[UnjudgedValue]:
    table, a = verdict_table(), columns.values
    if not a.size or not np.isfinite(a).any():
        return []
    largest = np.nanmax(np.where(np.isfinite(a), a, -np.inf), axis=0)
    strongest = columns.names[int(np.argmax(largest))]
    figures = [UnjudgedValue("muscles", "largest activation", float(largest.max()), "1", f"{strongest}; {note}")]
    if brief:
        return figures
    highest = np.nanmax(a[np.isfinite(a).any(axis=1)], axis=1)
    figures.append(UnjudgedValue("muscles", "mean activation of all muscles", float(np.nanmean(a)), "1", note))
    for name in ("active", "very_active"):
        level = table.values[name]
        share = float(np.mean(highest > level.value))
        label = f"share of time with a muscle above {level.value:g}"
        figures.append(UnjudgedValue("muscles", label, share, "1", f"{table.mark_of(level)}; {note}"))
    return figures


def _contact(contact: Mapping[str, FloatArray], how: str) -> list[UnjudgedValue]:
    """Return figures about joint contact forces.

    Args:
        contact: magnitude of the force by joint centre, shape (n,) each [N]; NaN: not known.
        how: origin of the forces, "computed" or "recorded".
    """
    figures = []
    for joint, force in contact.items():
        size = force[np.isfinite(force)]
        if len(size):
            note = f"mean {size.mean():.0f} N; {how}, {MODEL}"
            figures.append(
                UnjudgedValue("joint load", f"largest contact force in {joint}", float(size.max()), "N", note)
            )
    return figures


def _computed(person: AssessedPerson | None) -> tuple[Columns, Columns, Mapping[str, FloatArray]] | None:
    """Compute the muscle load of a simulated human whose body and grips are known; None: not known.

    Returns:
        activation as modelled; activation with weaker muscles; magnitude of the joint contact force by joint centre,
            shape (n,) [N].
    """
    if person is None or person.settings is None or person.record is None:
        return None
    record = person.record
    try:
        muscles, factor = person.settings.muscles, verdict_table()["weak_shoulder"]
        anatomy = find(muscles.anatomy, "human.muscles.anatomy")
        root = person.settings.root(person.body)
        modelled, contact = _over(person, record, anatomy, root, muscles.strength)
        return modelled, _over(person, record, anatomy, root, factor * muscles.strength)[0], contact
    except HricError:  # the motion is too short, the body has no arms, or the file of muscles no longer exists
        return None


def _over(
    person: AssessedPerson, record: HumanRecord, anatomy: Anatomy, root: Pose, strength: float
) -> tuple[Columns, Mapping[str, FloatArray]]:
    """Return activation of the muscles, without joint actuators, and magnitude of the joint contact forces [N]."""
    pieces: list[MuscleLoad] = []
    begin = float(record.time[0])
    while begin < record.time[-1] - OVERLAP or not pieces:
        rows = (record.time >= begin - OVERLAP) & (record.time <= begin + PIECE + OVERLAP)
        part = replace(record, time=record.time[rows], position=record.position[rows])
        motion, moved = motion_of(part, list(person.body.joints), root, CUTOFF, RATE)
        inside = (motion.time >= begin) & (motion.time < begin + PIECE)
        motion = RecordedMotion(*(values[inside] for values in (motion.time, motion.q, motion.dq, motion.ddq)))
        if not isinstance(moved, Pose):
            moved = RootMotion(*(values[inside] for values in moved))
        acting = grip_loads(record.grips.values(), motion.time)
        pieces.append(load_of(person.body, anatomy, moved, motion, acting, strength))
        begin += PIECE
    muscles = np.flatnonzero(pieces[0].is_muscle)
    names = tuple(pieces[0].names[k] for k in muscles)
    time = np.concatenate([piece.time for piece in pieces])
    values = np.concatenate([piece.activation[:, muscles] for piece in pieces])
    sizes = [{name: np.linalg.norm(force, axis=1) for name, force in piece.contact.items()} for piece in pieces]
    contact = {name: np.concatenate([piece[name] for piece in sizes]) for name in sizes[0]}
    return Columns("computed", names, time, values), contact
