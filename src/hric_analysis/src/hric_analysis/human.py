"""Metrics of the simulated human of a run: grips, joint torque relative to strength, hand, contacts. No ROS.

All values are estimates of a model, never measurements of a person.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from hric_analysis import carrying, muscle_metrics
from hric_analysis.carrying import Transport, hands_over
from hric_analysis.human_values import (
    SETTLED,
    SETTLES,
    SETTLING_TIME,
    UNSTABLE,
    ContactMetrics,
    GripMetrics,
    HandMetrics,
    Handover,
    HumanMetrics,
    JointLoad,
    Settling,
)
from hric_assessment.contact.impact import ExpectedContact, expected_contacts
from hric_assessment.ergonomics.effort import effort, log_dimensionless_jerk
from hric_bags.parts import Bag
from hric_bags.reader import FloatArray, RunRecord
from hric_bags.records import RecordedHumanEvent
from hric_bags.records.human_record import GripRecord, HumanRecord, read
from hric_bags.run_file import Definition, NodeParameters, RunFile
from hric_core.json_values import from_json
from hric_human.control.kinematics import HandChain
from hric_human.participant.settings import HumanSettings


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


def analyse(bag: Path | Bag, run: RunFile, description: str, record: RunRecord) -> SimulatedPerson | None:
    """Read and analyse the data of a run's simulated human; None: no human, or one sample only.

    Args:
        bag: bag of the run.
        run: contents of run.yaml.
        description: URDF of the robot; "": the run folder has none.
        record: control log with setpoints, profiles and reflexes.
    """
    definition = run.get("definition") or {}
    recorded = None if definition.get("human") is None else read(bag, record.robot_time)
    if recorded is None or len(recorded.time) < 2:
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


def _faded(time: FloatArray, values: FloatArray, begin: float, end: float) -> float | None:
    """Return the time from `end` until values stay below SETTLED times the motion's peak [s]; None: they never do."""
    peak = float(values[(time >= begin) & (time <= end)].max())
    above = time[(time > end) & (values > SETTLED * peak)]
    if not len(above):
        return 0.0
    return None if above[-1] >= time[-1] else float(above[-1] - end)
