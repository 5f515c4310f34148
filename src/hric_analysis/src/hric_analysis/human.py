"""Effort and motion of the simulated human of a run: grips, torque as share of strength, hand, contacts. No ROS.

All values are estimates of a model, never measurements of a person.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from hric_analysis import carrying, muscle_metrics
from hric_analysis.carrying import Transport, TransportMetrics, hands_over
from hric_analysis.muscle_metrics import MusclesMetrics
from hric_assessment.contact.impact import ExpectedContact, expected_contacts
from hric_assessment.ergonomics.effort import effort, log_dimensionless_jerk
from hric_bags.parts import Bag
from hric_bags.reader import FloatArray, RunRecord
from hric_bags.records.human_record import GripRecord, HumanRecord, RecordedHumanEvent, read
from hric_bags.run_file import Definition, NodeParameters, RunFile
from hric_core.geometry import Vector
from hric_core.json_values import from_json
from hric_human.control.kinematics import HandChain
from hric_human.participant.settings import HumanSettings

SETTLED, SETTLING_TIME = 0.05, 3.0
"""Share of their peaks below which grip force and hand speed must fall, and the time limit for it after the end of the
motion [s] (requirement of this project on stable guidance)."""
SETTLES, UNSTABLE = "settles", "unstable"


@dataclass(frozen=True)
class SimulatedPerson:
    """Simulated human of a run.

    Attributes:
        record: recording from the bag.
        impacts: contacts with their expected values.
        transports: bodies that two grips carried together.
    """

    record: HumanRecord
    impacts: tuple[ExpectedContact, ...] = ()
    transports: Sequence[Transport] = ()


@dataclass(frozen=True)
class GripMetrics:
    """Force and work of one grip; see `hric_assessment.ergonomics.effort.Effort`.

    Attributes:
        held, holder: names of both bodies.
        slips: how many times the body slipped; slipped: largest distance [m].
    """

    held: str
    holder: str
    closed: float
    force_max: float | None
    force_max_time: float | None = None
    force_mean: float | None = None
    torque_max: float | None = None
    work: float | None = None
    work_absolute: float | None = None
    slips: int | None = None
    slipped: float | None = None


@dataclass(frozen=True)
class Handover:
    """Handover of a body.

    Attributes:
        object, giver, taker: names of the body and of both grips.
        overlap: time for which both held the body [s].
        force_max: largest force of the taker in that time [N]; None: they never held it together.
        dropped: True if no grip held the body for some time.
    """

    object: str
    giver: str
    taker: str
    overlap: float
    force_max: float | None
    dropped: bool


@dataclass(frozen=True)
class JointLoad:
    """Load of one joint of the person.

    Attributes:
        torque_max: largest torque [N m].
        share_max, share_mean: largest and mean share of the strength [1].
        clipped: how many times the joint reached its strength limit.
    """

    torque_max: float
    share_max: float
    share_mean: float
    clipped: int


@dataclass(frozen=True)
class HandMetrics:
    """Motion of the hand.

    Attributes:
        speed_max: largest speed [m/s].
        path: length of the path [m].
        smoothness: log dimensionless jerk [1]; None: it did not move.
    """

    speed_max: float
    path: float
    smoothness: float | None


@dataclass(frozen=True)
class Settling:
    """Decay of grip forces and hand speed after the motion.

    Attributes:
        after: time after which the speed or the force of a grip stays low [s]; None: never.
        verdict: SETTLES or UNSTABLE.
    """

    after: dict[str, float | None]
    verdict: str

    @property
    def decay(self) -> str:
        """Times of the decay as text."""
        parts = [f"{name} {'never' if t is None else f'{t:.2f} s'}" for name, t in self.after.items()]
        return f"below {100 * SETTLED:.0f} % of the peak after: {', '.join(parts)}"


@dataclass(frozen=True)
class ExpectedImpact:
    """Closed form of an impact; see `hric_assessment.contact.impact`.

    Attributes:
        measured_peak: recorded peak until the half sine ends [N]; ratio: relative to the expected peak [1].
    """

    speed: float
    robot_mass: float
    human_mass: float
    stiffness: float
    mass: float
    peak: float
    duration: float
    impulse: float
    measured_peak: float
    ratio: float


@dataclass(frozen=True)
class ClampingMetrics:
    """Clamping at the instant of judgement.

    Attributes:
        time: robot time [s].
        force, balanced: contact force, and the force that the commanded torque balances [N].
        ratio: force relative to the balanced force [1].
    """

    time: float
    force: float
    balanced: float
    ratio: float


@dataclass(frozen=True)
class ContactMetrics:
    """Contact of a region of the person with its expected values.

    Attributes:
        point, normal, speed: begin_point, begin_normal and begin_speed of `hric_human.contact.RegionContact`, to which
            the attributes up to `interrupted` belong.
        transient: closed form of the impact; None: not known.
        press: clamping; None: there was none.
    """

    regions: tuple[str, ...]
    link: str
    other: str
    kind: str
    begin: float
    duration: float
    peak: float | None
    peak_time: float | None
    impulse: float | None
    point: Vector | None
    normal: Vector | None
    speed: float | None
    dominant: bool | None
    area: float | None
    ended: bool
    interrupted: bool
    transient: ExpectedImpact | None
    press: ClampingMetrics | None


@dataclass(frozen=True)
class HumanMetrics:
    """Effort, motion and contacts of the simulated human.

    Attributes:
        subject: code of the body.
        motion: begin and end of the motion, robot time [s].
        grips, handovers, carried: grips, handovers and transports.
        joints: load of each joint.
        strength_share_max, strength_share_mean: largest share of strength, and mean of the most loaded joint [1].
        muscles: use of the muscles; None: no muscle drive.
        hand: motion of the hand.
        settling: decay after the motion; None: not judged.
        contacts: contacts in the order of their ends.
        events: events of the human.
    """

    subject: str
    motion: tuple[float, ...]
    grips: dict[str, GripMetrics]
    handovers: tuple[Handover, ...]
    carried: tuple[TransportMetrics, ...]
    joints: dict[str, JointLoad]
    strength_share_max: float
    strength_share_mean: float
    muscles: MusclesMetrics | None
    hand: HandMetrics
    settling: Settling | None
    contacts: tuple[ContactMetrics, ...]
    events: tuple[RecordedHumanEvent, ...]


def analyse(bag: Path | Bag, run: RunFile, description: str, record: RunRecord) -> SimulatedPerson | None:
    """Analyse the simulated human of a run; None: there was none.

    Args:
        bag: bag of the run.
        run: contents of run.yaml.
        description: URDF of the robot; "": the run folder has none.
        record: control log with setpoints, profiles and reflexes.
    """
    definition = run.get("definition") or {}
    recorded = None if definition.get("human") is None else read(bag, record.robot_time)
    if recorded is None:
        return None
    contacts = tuple(expected_contacts(run, description, record, recorded))
    return SimulatedPerson(recorded, contacts, transports_in(recorded, definition))


def transports_in(record: HumanRecord, definition: Definition) -> list[Transport]:
    """Return the bodies that two grips carried together; definition: contents of the experiment."""
    plant = (definition.get("robot") or {}).get("plant") or {}
    return carrying.transports(record.grips.values(), definition.get("human") or {}, plant)


def metrics(person: SimulatedPerson, section: NodeParameters) -> HumanMetrics:
    """Return the metrics of the person; section: `human` of the experiment, for the body."""
    record = person.record
    hand = hand_positions(record, section)
    velocity = np.gradient(hand, record.time, axis=0)
    begin, end = moved(record.events, record.time)
    transports = (carrying.metrics(transport, begin, end) for transport in person.transports)
    return HumanMetrics(
        HumanSettings.of(section, "human").person.code,
        (begin, end),
        {name: _grip(grip, record.events) for name, grip in record.grips.items()},
        tuple(_handovers(record.grips.values())),
        tuple(transport for transport in transports if transport is not None),
        {name: _joint(record, index) for index, name in enumerate(record.joints)},
        float(np.abs(record.share).max()),
        float(np.abs(record.share).max(axis=1).mean()),
        None if record.muscles is None else muscle_metrics.metrics(record.muscles),
        _hand(record.time, hand, velocity, begin, end),
        _settling(record, velocity, begin, end, {end for transport in person.transports for end in transport.ends}),
        tuple(from_json(ContactMetrics, impact.values()) for impact in person.impacts),
        tuple(record.events),
    )


def hand_positions(record: HumanRecord, section: NodeParameters) -> FloatArray:
    """Return the positions of the dominant or only hand in axes of the root link, shape (n, 3) [m]."""
    body = HumanSettings.of(section, "human").body()
    sides = (body.subject.dominant_hand, "right", "left")
    hand = HandChain(body, next(side for side in sides if f"{side}_hand" in body.segments))
    return np.array([hand.pose(q).position for q in record.position.tolist()])


def moved(events: Sequence[RecordedHumanEvent], time: FloatArray) -> tuple[float, float]:
    """Return start and end of the motion from its events [s]; without an event, start or end of the recording."""
    begins = [event.time for event in events if event.kind == "started"]
    ends = [event.time for event in events if event.kind == "ended"]
    begin = begins[-1] if begins else float(time[0])
    return begin, ends[-1] if ends and ends[-1] > begin else float(time[-1])


def _grip(grip: GripRecord, events: Sequence[RecordedHumanEvent]) -> GripMetrics:
    used = effort(grip)
    if used is None:
        return GripMetrics(grip.held, grip.holder, 0.0, None)
    slips = sum(event.kind == "slipped" and event.name == grip.name for event in events)
    return GripMetrics(grip.held, grip.holder, **vars(used), slips=slips, slipped=float(grip.slipped.max()))


def _handovers(grips: Iterable[GripRecord]) -> Iterator[Handover]:
    """Yield the handovers in the order in which the givers closed."""
    first = {grip.name: float(grip.time[grip.closed][0]) for grip in grips if grip.closed.any()}
    in_order = sorted((grip for grip in grips if grip.name in first), key=lambda grip: first[grip.name])
    for giver, taker in combinations(in_order, 2):
        if giver.held != taker.held or not hands_over(giver, taker):
            continue
        n = min(len(giver.time), len(taker.time))
        both, none = giver.closed[:n] & taker.closed[:n], ~(giver.closed[:n] | taker.closed[:n])
        force = np.linalg.norm(taker.force[:n], axis=1)[both]
        yield Handover(
            giver.held,
            giver.name,
            taker.name,
            float(np.gradient(taker.time[:n])[both].sum()),
            float(force.max()) if both.any() else None,
            bool(none[taker.time[:n] > first[giver.name]].any()),
        )


def _joint(record: HumanRecord, index: int) -> JointLoad:
    share, torque = np.abs(record.share[:, index]), float(np.abs(record.torque[:, index]).max())
    return JointLoad(torque, float(share.max()), float(share.mean()), record.clipped[record.joints[index]])


def _hand(time: FloatArray, hand: FloatArray, velocity: FloatArray, begin: float, end: float) -> HandMetrics:
    during = (time >= begin) & (time <= end)
    speed = np.linalg.norm(velocity, axis=1)[during]
    path, smoothness = np.trapezoid(speed, time[during]), log_dimensionless_jerk(time[during], velocity[during])
    return HandMetrics(float(speed.max()), float(path), smoothness)


def _settling(
    record: HumanRecord, velocity: FloatArray, begin: float, end: float, carrying_ends: Collection[str]
) -> Settling | None:
    """Return the decay of grip forces and hand speed after the motion; None: the run is too short, or no grip closed.

    The force of a grip that carries a body is taken relative to its final value, since the weight remains.
    """
    closed = [grip for grip in record.grips.values() if grip.closed.any()]
    if not closed or record.time[-1] < end + SETTLING_TIME:
        return None
    curves = {"speed": (record.time, np.linalg.norm(velocity, axis=1))}
    for grip in closed:
        force = grip.force - grip.force[-1] if grip.name in carrying_ends else grip.force
        curves[grip.name] = grip.time, np.linalg.norm(force, axis=1)
    after = {name: _faded(time, values, begin, end) for name, (time, values) in curves.items()}
    fades = all(value is not None and value <= SETTLING_TIME for value in after.values())
    return Settling(after, SETTLES if fades else UNSTABLE)


def instability_reasons(settling: Settling | None) -> list[str]:
    """Return the reasons why a run is unstable because of its human, for `Stability.also`."""
    if settling is None or settling.verdict != UNSTABLE:
        return []
    return [f"robot and human do not come to rest within {SETTLING_TIME:g} s after the motion: {settling.decay}"]


def _faded(time: FloatArray, values: FloatArray, begin: float, end: float) -> float | None:
    """Return the time after the end until values stay below SETTLED times the motion's peak [s]; None: never."""
    peak = float(values[(time >= begin) & (time <= end)].max())
    above = time[(time > end) & (values > SETTLED * peak)]
    if not len(above):
        return 0.0
    return None if above[-1] >= time[-1] else float(above[-1] - end)
