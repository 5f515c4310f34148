"""Metrics of the simulated human of a run: grips, joint torque relative to strength, hand, contacts. No ROS.

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
"""Requirement of this project on stable guidance: grip force and hand speed fall below this share of their peaks [1]
within this time after the end of the motion [s]."""
SETTLES, UNSTABLE = "settles", "unstable"


@dataclass(frozen=True)
class SimulatedPerson:
    """Recorded data of a run's simulated human.

    Attributes:
        record: recording from the bag.
        impacts: contacts with their expected (closed-form) values.
        transports: bodies that two grips carried together.
    """

    record: HumanRecord
    impacts: tuple[ExpectedContact, ...] = ()
    transports: Sequence[Transport] = ()


@dataclass(frozen=True)
class GripMetrics:
    """Force and work of one grip.

    Attributes:
        held, holder: names of the held and of the holding body.
        closed: time for which the grip was closed [s].
        force_max, force_max_time: largest force [N] and its time [s].
        slips: number of times that the body slipped; slipped: largest slip distance [m].
        force_mean, torque_max, work, work_absolute: see `hric_assessment.ergonomics.effort.Effort`.
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
    """Handover of a body from one grip to another.

    Attributes:
        object, giver, taker: names of the body, of the giving and of the taking grip.
        overlap: time for which both held the body [s].
        force_max: largest force of the taker in this time [N]; None: both never held the body together.
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
        share_max, share_mean: largest and mean ratio of torque to strength [1].
        clipped: number of times that the joint reached its strength limit.
    """

    torque_max: float
    share_max: float
    share_mean: float
    clipped: int


@dataclass(frozen=True)
class HandMetrics:
    """Motion of the person's hand.

    Attributes:
        speed_max: largest speed [m/s].
        path: length of the path [m].
        smoothness: log dimensionless jerk [1]; None: the hand did not move.
    """

    speed_max: float
    path: float
    smoothness: float | None


@dataclass(frozen=True)
class Settling:
    """Decay of grip forces and hand speed after the motion.

    Attributes:
        after: time after the motion from which the hand speed or a grip force stays low, by name [s]; None: never.
        verdict: SETTLES or UNSTABLE.
    """

    after: dict[str, float | None]
    verdict: str

    @property
    def decay(self) -> str:
        """Text with the time after which each signal stays low."""
        parts = [f"{name} {'never' if t is None else f'{t:.2f} s'}" for name, t in self.after.items()]
        return f"below {100 * SETTLED:.0f} % of the peak after: {', '.join(parts)}"


@dataclass(frozen=True)
class ExpectedImpact:
    """Expected values of an impact (closed form) and the recorded peak; see `hric_assessment.contact.impact`.

    Attributes:
        measured_peak: recorded peak force until the half sine ends [N]; ratio: measured over expected peak [1].
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
    """Clamping force at the instant at which it is assessed.

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
    """Contact of a body region of the person, with its expected values.

    Attributes:
        point, normal, speed: begin_point, begin_normal and begin_speed of `hric_human.contact.RegionContact`, to which
            the attributes up to `interrupted` belong.
        transient: expected values of the impact; None: not known.
        press: clamping force; None: there was no clamping.
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
        grips, handovers, carried: metrics of grips, of handovers, and of carried bodies.
        joints: load of each joint.
        strength_share_max, strength_share_mean: largest ratio of joint torque to strength, and its mean over time for
            the most loaded joint at each instant [1].
        muscles: metrics of the muscles; None: muscles do not drive the human.
        hand: motion of the hand.
        settling: decay after the motion; None: not assessed.
        contacts: contacts, in the order in which they ended.
        events: recorded events of the human, such as started or slipped.
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
    """Read and analyse the data of a run's simulated human; None: there was no human.

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
    """Return the bodies that two grips carried together; `definition`: content of the experiment file."""
    plant = (definition.get("robot") or {}).get("plant") or {}
    return carrying.transports(record.grips.values(), definition.get("human") or {}, plant)


def metrics(person: SimulatedPerson, section: NodeParameters) -> HumanMetrics:
    """Return the metrics of the simulated human; `section`: section `human` of the experiment."""
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
    """Return the positions of the dominant (or only) hand relative to the body's root link, shape (n, 3) [m]."""
    body = HumanSettings.of(section, "human").body()
    sides = (body.subject.dominant_hand, "right", "left")
    hand = HandChain(body, next(side for side in sides if f"{side}_hand" in body.segments))
    return np.array([hand.pose(q).position for q in record.position.tolist()])


def moved(events: Sequence[RecordedHumanEvent], time: FloatArray) -> tuple[float, float]:
    """Return start and end of the human's motion from its events [s]; without events, those of the recording."""
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
    """Yield the handovers, in the order in which the giving grips closed."""
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

    For a grip that carries a body, the force is taken relative to its final value, since the weight remains.
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
    """Return the reasons, as text, why the interaction of robot and human is unstable; empty: it is not."""
    if settling is None or settling.verdict != UNSTABLE:
        return []
    return [f"robot and human do not come to rest within {SETTLING_TIME:g} s after the motion: {settling.decay}"]


def _faded(time: FloatArray, values: FloatArray, begin: float, end: float) -> float | None:
    """Return the time from `end` until values stay below SETTLED times the motion's peak [s]; None: they never do."""
    peak = float(values[(time >= begin) & (time <= end)].max())
    above = time[(time > end) & (values > SETTLED * peak)]
    if not len(above):
        return 0.0
    return None if above[-1] >= time[-1] else float(above[-1] - end)
