"""Contact events between person and robot: assessment results, with the state of the arm as each contact began."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np

from hric_analysis import supervised
from hric_analysis.contacts import counted_share
from hric_assessment.contact.limits import PARTED, TRANSIENT_TIME
from hric_assessment.findings import Finding, Outcome
from hric_bags.parts import Bag
from hric_bags.reader import ControlRecord
from hric_bags.records import safety_record
from hric_msgs.msg import RegionContacts
from hric_run.simulation import Simulation
from hric_supervisor.arm import ArmShape, ArmState
from hric_supervisor.separation import STANDING
from hric_sweep.records import PlainData

BEFORE = 0.002
"""Time from reading the arm's speed to the contact [s], since the contact changes that speed (project default)."""
MOVING, STANDING_ARM, PUSHED = "moving", "standing", "pushed"
"""States of the arm as a contact begins; pushed: the arm stood still until an earlier contact moved it."""
LONGEST = 2.0 * TRANSIENT_TIME
"""Longest time from the first touch to the end of a run [s]: twice the time after which a contact counts as a clamp."""
SUPERVISED = safety_record.TYPES
"""Message types of a supervisor's decisions."""
CHUNK = 0.05
"""Robot time between two checks for the end of a run [s]."""


@dataclass(frozen=True)
class ContactEvent:
    """Contact between person and robot, with the result of its assessment (its finding).

    Attributes:
        time, end: first and last touch, robot time [s].
        subject: bodies that touched, as in the finding.
        regions: regions of ISO/TS 15066 that may have been touched.
        arm: MOVING, STANDING_ARM or PUSHED.
        arm_speed: speed of the arm's fastest point, shortly (BEFORE) before the contact [m/s].
        speed: relative speed at the contact [m/s]; None: not known.
        peak: peak force [N]; NaN: not known.
        outcome: assessment result, such as above limits.
        share: ratio of the measured value to its limit, see `counted_share` [1].
        reason: reason for the outcome.
    """

    time: float
    end: float
    subject: str
    regions: str
    arm: str
    arm_speed: float
    speed: float | None
    peak: float
    outcome: Outcome
    share: float
    reason: str


def contact_events(findings: Sequence[Finding], log: ControlRecord, description: str) -> list[ContactEvent]:
    """Return the contact events in the order in which the contacts began.

    Args:
        findings: findings on contacts of the verdict; a finding that nothing touched the person is left out.
        log: control log of the robot, every cycle.
        description: URDF of the robot.
    """
    touches = [finding for finding in findings if not (finding.outcome == Outcome.WITHIN and finding.share == 0.0)]
    events, first = list[ContactEvent](), math.inf
    for finding in sorted(touches, key=lambda finding: finding.window or (-math.inf, math.inf)):
        begin, end = finding.window or (float(log.time[0]), float(log.time[-1]))
        speed = _arm_speed(log, description, begin - BEFORE)
        state = STANDING_ARM if speed < STANDING and finding.window else MOVING
        if state == MOVING and first < begin - BEFORE and _arm_speed(log, description, first - BEFORE) < STANDING:
            state = PUSHED
        first = min(first, begin)
        events.append(_event(finding, (begin, end), state, speed))
    return events


def impact(events: Sequence[ContactEvent]) -> dict[str, list[PlainData]]:
    """Return contact events as plain data, in groups; each has one boolean per possible outcome, named in lower case.

    contacts: all; moving: contacts that began while the arm moved; standing: all other contacts; exceeding: contacts
    with a moving arm that are above limits by a known ratio.
    """
    outcomes = [{outcome.name.lower(): event.outcome == outcome for outcome in Outcome} for event in events]
    rows = [{**asdict(event), **states} for event, states in zip(events, outcomes, strict=True)]
    moving = [row for row in rows if row["arm"] == MOVING]
    return {
        "contacts": list(rows),
        "moving": list(moving),
        "standing": [row for row in rows if row["arm"] != MOVING],
        "exceeding": [row for row in moving if row["above"] and math.isfinite(row["share"])],
    }


def _event(finding: Finding, window: tuple[float, float], arm: str, arm_speed: float) -> ContactEvent:
    values = finding.values
    peaks = [values.get(f"{part} peak [N]") for part in ("transient", "quasi-static")]
    return ContactEvent(
        *window,
        finding.subject,
        ", ".join(finding.regions),
        arm,
        arm_speed,
        values.get("speed at contact [m/s]"),
        max((peak for peak in peaks if peak is not None), default=math.nan),
        finding.outcome,
        counted_share(finding),
        finding.reason,
    )


def _arm_speed(log: ControlRecord, description: str, time: float) -> float:
    """Return the speed of the arm's fastest point [m/s] at `time` [s]; `description`: URDF of the robot."""
    at = int(np.clip(np.searchsorted(log.time, time), 0, len(log.time) - 1))
    state = ArmState(time, log.position[at], log.velocity[at])
    return float(np.linalg.norm(_shape(description, log.joint_names).at(state).velocities, axis=2).max())


@cache
def _shape(description: str, joints: tuple[str, ...]) -> ArmShape:
    """Return the shape of the arm in a URDF, built once per process."""
    return ArmShape(description, joints)


def run_until_contact_ends(simulation: Simulation) -> None:
    """Run until the first contact with the person has ended or lasted LONGEST.

    A run without contact ends LONGEST before the duration of the experiment.
    """
    touches, end = list[float](), simulation.definition.duration - LONGEST

    def on_contacts(message: RegionContacts) -> None:
        if message.touching:
            touches.append(simulation.time)

    simulation.node.subscribe("hric/human/contacts", RegionContacts, on_contacts)
    while not _over(simulation.time, end, touches):
        simulation.run(CHUNK)


def _over(time: float, end: float, touches: Sequence[float]) -> bool:
    """Return True if a run is over; `touches`: robot times of all messages that report a contact so far [s]."""
    if not touches:
        return time >= end - 1e-9
    return time > touches[-1] + PARTED + CHUNK or time >= touches[0] + LONGEST


def supervision(bag: Bag, robot_time: Callable[[float], float]) -> PlainData | None:
    """Summarise the decisions of the supervisor as in metrics.json; None: there are none.

    Args:
        bag: bag with messages of SUPERVISED.
        robot_time: function that converts a stamp to robot time [s].

    Returns:
        separation: smallest distance between person and arm [m]; None: never known. violations: number of decisions
        while the arm moved nearer to the person than the protective distance. stopped and slowed: shares of the time
        [1].
    """
    record = safety_record.read(bag, robot_time)
    if record is None or (values := supervised.metrics(record)) is None:
        return None
    return {
        "separation": values.separation_min,
        "violations": float(record.violation.sum()),
        "stopped": values.share_stopped,
        "slowed": values.share_slowed,
    }
