"""What a run required of the human in it: grip, torque as share of strength, and how he moved. No ROS.

All of it is of the simulated human: an estimate of a model, never a measurement of a person.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from hric_analysis import carrying, muscle_metrics
from hric_analysis.carrying import Carried, hands_over
from hric_assessment.contact.impact import ExpectedContact, expected_contacts
from hric_assessment.ergonomics.effort import effort, log_dimensionless_jerk
from hric_bags.parts import Bag
from hric_bags.reader import FloatArray, RunRecord
from hric_bags.records.human_record import Event, GripRecord, HumanRecord, read
from hric_human.body import describe
from hric_human.control.kinematics import HandChain
from hric_human.participant.settings import HumanSettings

SETTLED, SETTLING_TIME = 0.05, 3.0
"""Share of their peaks below which grip force and speed of the hand must have come, and the time for it after the
motion's end [s] (the demand of this project on a stable guidance)."""
SAMPLE = "between two people 2.28 s and 7.3 N in one published sample"
"""Of handovers: the sample in KTH-RPL/handovers_dataset (MIT)."""
SETTLES, UNSTABLE = "settles", "unstable"


@dataclass(frozen=True)
class Person:
    """What a run has of a human.

    Attributes:
        record: from the bag.
        values: the key `human` of metrics.json.
        impacts: contacts beside what is expected of them.
        carried: bodies that two grips carried.
    """

    record: HumanRecord
    values: dict[str, Any]
    impacts: tuple[ExpectedContact, ...] = ()
    carried: Sequence[Carried] = ()


def analyse(bag: Bag, run: Mapping[str, Any], description: str, record: RunRecord) -> Person | None:
    """What a run required of the human; None where nobody stood there.

    Args:
        bag: of the run.
        run: contents of run.yaml.
        description: URDF of the robot; "": the run folder has none.
        record: the rest of the bag.
    """
    definition = run.get("definition") or {}
    section = definition.get("human")
    found = None if section is None else read(bag, record.robot_time)
    if found is None or section is None:
        return None
    met, carried = expected_contacts(run, description, record, found), carried_in(found, definition)
    return Person(found, metrics(found, section, met, carried), tuple(met), carried)


def carried_in(record: HumanRecord, definition: Mapping[str, Any]) -> list[Carried]:
    """Bodies that two grips carried; definition: of the experiment."""
    plant = (definition.get("robot") or {}).get("plant") or {}
    return carrying.carried(record.grips.values(), definition.get("human") or {}, plant)


def metrics(
    record: HumanRecord,
    section: Mapping[str, Any],
    met: Sequence[ExpectedContact] = (),
    carried: Sequence[Carried] = (),
) -> dict[str, Any]:
    """For metrics.json.

    Args:
        record: from the bag.
        section: `human` of the experiment, for the body.
        met: his contacts.
        carried: bodies that two grips carried.
    """
    hand = hand_positions(record, section)
    velocity = np.gradient(hand, record.time, axis=0)
    begin, end = moved(record.events, record.time)
    return {
        "subject": HumanSettings.of(section, "human").person.code,
        "motion": [begin, end],
        "grips": {name: _grip(grip, record.events) for name, grip in record.grips.items()},
        "handovers": _handovers(record.grips.values()),
        "carried": [found for one in carried if (found := carrying.metrics(one, begin, end)) is not None],
        "joints": {name: _joint(record, index) for index, name in enumerate(record.joints)},
        "strength_share_max": float(np.abs(record.share).max()),
        "strength_share_mean": float(np.abs(record.share).max(axis=1).mean()),
        "muscles": None if record.muscles is None else muscle_metrics.metrics(record.muscles),
        "hand": _hand(record.time, hand, velocity, begin, end),
        "settling": _settling(record, velocity, begin, end, {end for one in carried for end in one.ends}),
        "contacts": [impact.values() for impact in met],
        "events": [vars(event) for event in record.events],
    }


def hand_positions(record: HumanRecord, section: Mapping[str, Any]) -> FloatArray:
    """Of the dominant hand, or of the one that there is, in axes of his root link, shape (n, 3) [m]."""
    body = describe(HumanSettings.of(section, "human").person)
    sides = (body.subject.dominant_hand, "right", "left")
    hand = HandChain(body, next(side for side in sides if f"{side}_hand" in body.segments))
    return np.array([hand.pose(q).position for q in record.position.tolist()])


def moved(events: Sequence[Event], time: FloatArray) -> tuple[float, float]:
    """Begin and end of the motion; those of the record where nobody said [s]."""
    begins = [event.time for event in events if event.kind == "started"]
    ends = [event.time for event in events if event.kind == "ended"]
    begin = begins[-1] if begins else float(time[0])
    return begin, ends[-1] if ends and ends[-1] > begin else float(time[-1])


def _grip(grip: GripRecord, events: Sequence[Event]) -> dict[str, Any]:
    own = [event for event in events if event.name == grip.name]
    found = effort(grip)
    if found is None:
        return {"held": grip.held, "holder": grip.holder, "closed": 0.0, "force_max": None}
    return {
        "held": grip.held,
        "holder": grip.holder,
        **vars(found),
        "slips": sum(event.kind == "slipped" for event in own),
        "slipped": float(grip.slipped.max()),
    }


def _handovers(grips: Iterable[GripRecord]) -> list[dict[str, Any]]:
    """Of each body that two grips held, one after the other: who gave it to whom, and how."""
    first = {grip.name: float(grip.time[grip.closed][0]) for grip in grips if grip.closed.any()}
    in_order = sorted((grip for grip in grips if grip.name in first), key=lambda grip: first[grip.name])
    found = []
    for giver, taker in combinations(in_order, 2):
        if giver.held != taker.held or not hands_over(giver, taker):
            continue
        n = min(len(giver.time), len(taker.time))
        both, none = giver.closed[:n] & taker.closed[:n], ~(giver.closed[:n] | taker.closed[:n])
        force = np.linalg.norm(taker.force[:n], axis=1)[both]
        found.append(
            {
                "object": giver.held,
                "giver": giver.name,
                "taker": taker.name,
                "overlap": float(np.gradient(taker.time[:n])[both].sum()),
                "force_max": float(force.max()) if both.any() else None,
                "dropped": bool(none[taker.time[:n] > first[giver.name]].any()),
            }
        )
    return found


def _joint(record: HumanRecord, index: int) -> dict[str, Any]:
    share = np.abs(record.share[:, index])
    return {
        "torque_max": float(np.abs(record.torque[:, index]).max()),
        "share_max": float(share.max()),
        "share_mean": float(share.mean()),
        "clipped": record.clipped[record.joints[index]],
    }


def _hand(time: FloatArray, hand: FloatArray, velocity: FloatArray, begin: float, end: float) -> dict[str, Any]:
    during = (time >= begin) & (time <= end)
    speed = np.linalg.norm(velocity, axis=1)[during]
    return {
        "speed_max": float(speed.max()),
        "path": float(np.trapezoid(speed, time[during])),
        "smoothness": log_dimensionless_jerk(time[during], velocity[during]),
    }


def _settling(
    record: HumanRecord, velocity: FloatArray, begin: float, end: float, carrying_ends: Collection[str]
) -> dict[str, Any] | None:
    """How force and speed fade after the motion; None: the run ends too early to judge, or nothing was held.

    The force of a grip that carries fades to what it carries at the end: a weight does not go.
    """
    closed = [grip for grip in record.grips.values() if grip.closed.any()]
    if not closed or record.time[-1] < end + SETTLING_TIME:
        return None
    speed = np.linalg.norm(velocity, axis=1)
    curves = {"speed": (record.time, speed)}
    for grip in closed:
        force = grip.force - grip.force[-1] if grip.name in carrying_ends else grip.force
        curves[grip.name] = grip.time, np.linalg.norm(force, axis=1)
    found = {name: _faded(time, values, begin, end) for name, (time, values) in curves.items()}
    fades = all(value is not None and value <= SETTLING_TIME for value in found.values())
    return {"after": found, "verdict": SETTLES if fades else UNSTABLE}


def unrest(settling: Mapping[str, Any] | None) -> list[str]:
    """Why a run is unstable, for `stability.reasons`; settling: of metrics.json."""
    if settling is None or settling["verdict"] != UNSTABLE:
        return []
    return [f"robot and human do not come to rest within {SETTLING_TIME:g} s after his motion: {_after(settling)}"]


def _faded(time: FloatArray, values: FloatArray, begin: float, end: float) -> float | None:
    """Time after the end from which values stay below their share of the motion's peak; None: they do not [s]."""
    peak = float(values[(time >= begin) & (time <= end)].max())
    above = time[(time > end) & (values > SETTLED * peak)]
    if not len(above):
        return 0.0
    return None if above[-1] >= time[-1] else float(above[-1] - end)


def render(found: Mapping[str, Any]) -> str:
    """As text for the report; found: of `metrics`."""
    lines = [
        f"human {found['subject']} (a model's estimate): at most {100 * found['strength_share_max']:.0f} % of the "
        f"strength of a joint, {100 * found['strength_share_mean']:.0f} % in the mean of the most loaded one"
    ]
    for name, grip in found["grips"].items():
        if grip["force_max"] is None:
            lines.append(f"- grip {name} never closed: {grip['holder']} did not come near {grip['held']}")
            continue
        lines.append(
            f"- grip {name} of {grip['held']}: {grip['force_max']:.1f} N at most, {grip['force_mean']:.1f} N in the "
            f"mean, work on it {grip['work']:+.2f} J ({grip['work_absolute']:.2f} J to and fro), slipped "
            f"{1e3 * grip['slipped']:.1f} mm ({grip['slips']} times)"
        )
    lines += [_handover(one) for one in found["handovers"]]
    lines += [carrying.render(one) for one in found["carried"]]
    lines += _contacts(found["contacts"])
    if found["muscles"] is not None:
        lines += muscle_metrics.render(found["muscles"])
    hand, clipped = found["hand"], {name: n for name, joint in found["joints"].items() if (n := joint["clipped"])}
    smooth = "-" if hand["smoothness"] is None else f"{hand['smoothness']:.2f}"
    lines.append(f"- hand: {hand['speed_max']:.2f} m/s at most, log dimensionless jerk {smooth}")
    if clipped:
        counts = ", ".join(f"{name} ({n} times)" for name, n in clipped.items())
        lines.append(f"- joints that came to their strength: {counts}")
    if found["settling"] is not None:
        lines.append(f"- after the motion: {_settled(found['settling'])}")
    return "\n".join(lines)


def _handover(one: Mapping[str, Any]) -> str:
    force = "-" if one["force_max"] is None else f"{one['force_max']:.1f} N"
    end = "IT FELL" if one["dropped"] else "it did not fall"
    return (
        f"- {one['giver']} gives {one['object']} to {one['taker']}: both hold it for {one['overlap']:.2f} s, {force} "
        f"of {one['taker']} at most then; {end} ({SAMPLE})"
    )


def _contacts(contacts: Sequence[Mapping[str, Any]]) -> list[str]:
    """Of those who met more often the strongest contact, and the first one that presses."""
    lines = []
    for same in together(contacts):
        hardest = strongest(same)
        lines += [_contact(hardest), *_expected(hardest), *[_press(one) for one in same if one["press"]][:1]]
        if len(same) > 1:
            peak, lasted = max(one["peak"] or 0.0 for one in same), sum(one["duration"] for one in same)
            force = f", {peak:.1f} N at most" if peak else ""
            lines.append(f"  they met {len(same)} times, for {lasted:.3f} s together{force}")
    return lines


def together(contacts: Sequence[Mapping[str, Any]]) -> list[list[Mapping[str, Any]]]:
    """Contacts of the same two bodies, in the order in which these came to their first end."""
    found: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for one in contacts:
        found.setdefault((one["link"], one["other"]), []).append(one)
    return list(found.values())


def strongest(same: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Of several contacts the one that should hit hardest by the closed form, else the one that did."""
    return max(same, key=lambda one: ((one["transient"] or {}).get("peak", 0.0), one["peak"] or 0.0))


def _contact(one: Mapping[str, Any]) -> str:
    where = f"{', '.join(one['regions']) or one['link']} met {one['other']} at {one['begin']:.3f} s"
    if one["peak"] is None:
        return f"- {where}, rigid: no force that could be called one on a person"
    return f"- {where} for {one['duration']:.3f} s: {one['peak']:.1f} N at most, {one['impulse']:.2f} N s"


def _expected(one: Mapping[str, Any]) -> list[str]:
    form = one["transient"]
    if form is None:
        return []
    return [
        f"  at {form['speed']:.3f} m/s with reflected masses of {form['robot_mass']:.2f} kg (robot with rotors) and "
        f"{form['human_mass']:.2f} kg (human) on {1e-3 * form['stiffness']:.0f} N/mm",
        f"  first peak {form['measured_peak']:.1f} N beside v sqrt(mu k) = {form['peak']:.1f} N: ratio "
        f"{form['ratio']:.3f}; its half sine {form['duration']:.3f} s, {form['impulse']:.2f} N s",
    ]


def _press(one: Mapping[str, Any]) -> str:
    press = one["press"]
    return (
        f"  pressed with {press['force']:.1f} N at {press['time']:.3f} s beside {press['balanced']:.1f} N that the "
        f"commanded torque balances: ratio {press['ratio']:.3f}"
    )


def _settled(settling: Mapping[str, Any]) -> str:
    return f"{settling['verdict']} ({_after(settling)})"


def _after(settling: Mapping[str, Any]) -> str:
    parts = [f"{name} {'never' if t is None else f'{t:.2f} s'}" for name, t in settling["after"].items()]
    return f"below {100 * SETTLED:.0f} % of the peak after: {', '.join(parts)}"
