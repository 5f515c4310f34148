"""Decisions of the supervisor: the speed scale that the arm may have, from the states of arm and persons."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from hric_assessment.contact.limits import Limits
from hric_assessment.contact.mass import Mechanism
from hric_assessment.contact.speed import speed_limit
from hric_assessment.findings import NotAssessableError
from hric_assessment.separation.protective import Terms
from hric_core.geometry import FloatArray, Vector
from hric_human.hand.startle import expected_speed
from hric_supervisor.arm import ArmShape, ArmState, InForce, PlacedCapsules
from hric_supervisor.perception import Watch
from hric_supervisor.person import HAND, Observation, joined, moved
from hric_supervisor.separation import (
    SCALES,
    STANDING,
    CapsuleNearness,
    Protective,
    StoppingModel,
    nearest_capsules,
    nearness,
)
from hric_supervisor.settings import HAND_GUIDED, POWER_AND_FORCE, STANDSTILL, SupervisorSettings

WORLD = "world"
FREE, SLOWED, STOPPED = "free", "slowed", "stopped"
UNHINDERED = InForce()
"""Speed scale of a robot that has received no request: full speed."""
_KINDS = {FREE: "freed", SLOWED: "slowed", STOPPED: "stopped"}


class DecisionEvent(NamedTuple):
    """Event that the supervisor publishes and logs.

    Attributes:
        kind: fault, recovered, stopped, slowed, freed, violation, moved, held, holder_lost or controller_stopped.
        text: description for the log.
    """

    kind: str
    text: str


class Permitted(NamedTuple):
    """Limits that the supervisor's mode permits.

    Attributes:
        scale: speed scale, 0 to 1.
        part: index of the person's capsule with the lowest limit; -1: none.
        contact_speed: permitted contact speed for that capsule's region [m/s]; NaN except in the mode
            power_and_force_limiting.
        stiffness, force: limits for Cartesian controllers [N/m], [N].
        reason: reason for the scale, in place of the default one with distances; empty: the default.
    """

    scale: float
    part: int
    contact_speed: float = math.nan
    stiffness: float = math.inf
    force: float = math.inf
    reason: str = ""


@dataclass(frozen=True)
class NearestPart:
    """Body part whose distance exceeds its protective distance by the least.

    Attributes:
        terms: terms of the body part's protective distance.
        margin: distance minus protective distance [m].
        robot_speed, person_speed: speeds v_r and v_h towards each other [m/s].
        robot_link, person_link: nearest links.
        region: region of ISO/TS 15066; several are joined by commas; empty if there is none.
        robot_point, person_point: nearest points on the capsule axes in the world [m].
    """

    terms: Terms
    margin: float
    robot_speed: float
    person_speed: float
    robot_link: str
    person_link: str
    region: str
    robot_point: Vector
    person_point: Vector


@dataclass(frozen=True)
class Decision:
    """Decision of the supervisor at one instant.

    Attributes:
        time: robot time [s].
        perception: stamp of the person's pose [s]; NaN before the first.
        state: free, slowed or stopped.
        scale: speed scale, 0 to 1.
        stiffness, force: limits for Cartesian controllers [N/m], [N].
        fault: reason why no decision was possible; empty: no fault. With a fault the scale is 0.
        reason: reason for the scale, as text.
        separation: smallest distance between arm and person [m]; NaN with a fault.
        part: body part with the smallest margin; None with a fault.
        violation: True if the arm moves although a body part is closer than its protective distance.
        contact_speed: permitted contact speed [m/s]; NaN except in the mode power_and_force_limiting.
        events: events since the previous decision.
    """

    time: float
    perception: float
    state: str
    scale: float
    stiffness: float = math.inf
    force: float = math.inf
    fault: str = ""
    reason: str = ""
    separation: float = math.nan
    part: NearestPart | None = None
    violation: bool = False
    contact_speed: float = math.nan
    events: Sequence[DecisionEvent] = field(default=())

    @property
    def margin(self) -> float:
        """Smallest margin of the body parts [m]; NaN with a fault."""
        return math.nan if self.part is None else self.part.margin


class PersonMotion:
    """Estimator of one person's velocities from two successive observations."""

    def __init__(self) -> None:
        self._before: Observation | None = None
        self._velocities = np.zeros((0, 2, 3))

    def reset(self) -> None:
        """Forget the previous observation."""
        self._before = None

    def velocities(self, person: Observation) -> FloatArray:
        """Return the velocities of the axis ends of the person's capsules, shape (m, 2, 3) [m/s]."""
        before, self._before = self._before, person
        if before is None or before.links != person.links:
            self._velocities = np.zeros_like(person.ends)
        elif person.stamp > before.stamp:
            self._velocities = (person.ends - before.ends) / (person.stamp - before.stamp)
        return self._velocities


class Supervisor:
    """Supervisor that decides cyclically; it stores what hysteresis and velocities need from earlier cycles.

    Args:
        settings: parameters of the supervisor.
        arm: capsules of the robot.
        rotors: rotor inertias at the joints, shape (j,) [kg m^2]; None: not known, taken as 0.
        frames: pose in the world of each frame in which persons may be observed, shape (4, 4); None: only the world.

    Raises:
        HricError: there is no such table of limits, or the table or the file of stops is invalid or for another robot.
    """

    def __init__(
        self,
        settings: SupervisorSettings,
        arm: ArmShape,
        rotors: FloatArray | None = None,
        frames: Mapping[str, FloatArray] | None = None,
    ) -> None:
        self._frames = {WORLD: np.eye(4)} if frames is None else frames
        self.settings, self._arm = settings, arm
        self._mechanism = Mechanism(
            arm.tree, arm.joints, [0.0] * len(arm.joints) if rotors is None else rotors.tolist()
        )
        self._limits = Limits.named(settings.table)
        self._stopping = StoppingModel(settings)
        self._stopping.check_robot(arm.tree.name, arm.is_franka)
        self._protective = Protective(settings, self._stopping)
        self._watch = Watch(settings, self._frames)
        self._speed = settings.speed
        self._scale, self._since, self._state, self._fault = 1.0, 0.0, FREE, ""
        self._violated = self._moved = self._stood = False
        self._motions = [PersonMotion() for _ in settings.persons]

    def decide(
        self,
        now: float,
        arm: ArmState | None,
        person: Observation | None,
        in_force: InForce = UNHINDERED,
        others: Sequence[Observation | None] = (),
    ) -> Decision:
        """Decide from the newest data which speed scale the arm may have from robot time `now` [s] on.

        Args:
            now: robot time [s].
            arm: state of the arm; None: not known.
            person: observation of the person; None: not known.
            in_force: speed scale that the robot obeys now.
            others: observations of further persons, in the order of `settings.persons`.
        """
        persons = (person, *others)
        fault = self._watch.fault(now, arm, persons)
        seen = [observation for observation in persons if observation is not None]
        stamp = min((observation.stamp for observation in seen), default=math.nan)
        if fault or arm is None or len(seen) < len(persons):
            return self._faulty(now, stamp, fault)
        seen = [moved(observation, WORLD, self._frames[observation.frame]) for observation in seen]
        velocities = [motion.velocities(observation) for motion, observation in zip(self._motions, seen, strict=True)]
        everybody = joined(seen, [name for name, _ in self.settings.persons])
        return self._decided(now, arm, everybody, np.concatenate(velocities), in_force)

    def _decided(
        self, now: float, arm: ArmState, person: Observation, velocities: FloatArray, in_force: InForce
    ) -> Decision:
        """Decide from valid data; velocities: of the axis ends of the person's capsules, shape (m, 2, 3) [m/s]."""
        placed, stamp = self._arm.at(arm), person.stamp
        fastest = placed.fastest
        if fastest > self._stopping.fastest:
            known = f"the table of stops goes up to {self._stopping.fastest:g} m/s"
            return self._faulty(now, stamp, f"the arm is too fast: {fastest:.2f} m/s, but {known}")
        self._speed = max(self._speed, fastest)
        near = nearness(placed, velocities, nearest_capsules(placed, person))
        allowed = self._allowed(arm, placed, person, near, 0.0)
        freer = self._allowed(arm, placed, person, near, self.settings.hysteresis)
        before = self._scale if self.settings.active else 1.0
        scale = self._smoothed(now, allowed.scale, freer.scale)
        at_rest = fastest < STANDING
        braking = self._stopping.left(now, min(arm.stamp, person.stamp), in_force, fastest)
        human, terms = self._protective.measured(near, braking)
        part = _part(placed, person, near, human, terms)
        # An arm that must stand still, has stopped, and moves again is moved by something else than its controller.
        self._stood = before == 0.0 and (self._stood or at_rest)
        violation = part.margin < 0.0 and not at_rest and not self._stood
        is_moved = self._stood and not at_rest
        reason = allowed.reason or self._reason(scale, allowed, placed, person, near)
        events = self._events(scale, "", reason, (violation, is_moved), part)
        nearest, speed = float(near.distance.min()), allowed.contact_speed
        stiffness, force = allowed.stiffness, allowed.force
        return Decision(
            now, stamp, self._state, scale, stiffness, force, "", reason, nearest, part, violation, speed, events
        )

    # -- faults and hysteresis -----------------------------------------------------------------------------------------

    def _faulty(self, now: float, stamp: float, fault: str) -> Decision:
        self._scale, self._since = 0.0, now
        for motion in self._motions:
            motion.reset()
        events = self._events(0.0, fault, fault, (False, False), None)
        return Decision(now, stamp, self._state, 0.0, fault=fault, reason=fault, events=events)

    def _smoothed(self, now: float, scale: float, freer: float) -> float:
        """Reduce the scale at once, or raise it if the person has been far enough away for the time `hold`.

        Args:
            now: robot time [s].
            scale: scale permitted now.
            freer: scale that is permitted with the hysteresis, as if the person were nearer.
        """
        if scale <= self._scale:
            if scale < self._scale or freer <= self._scale:
                self._since = now
            self._scale = scale
        elif freer <= self._scale:
            self._since = now
        elif now - self._since >= self.settings.hold:
            self._scale = freer
        return self._scale

    def _events(
        self, scale: float, fault: str, reason: str, moves: tuple[bool, bool], part: NearestPart | None
    ) -> list[DecisionEvent]:
        """Return the new events, and store the state for the next decision.

        Args:
            scale: speed scale of the decision.
            fault: fault of the decision; empty: none.
            reason: reason for the scale.
            moves: True if the arm moves although it must not; True if something else than its controller moves it.
            part: body part with the smallest margin; None with a fault.
        """
        events = []
        violation, is_moved = moves
        if fault and fault.split(":")[0] != self._fault.split(":")[0]:
            events.append(DecisionEvent("fault", fault))
        elif self._fault and not fault:
            events.append(
                DecisionEvent("recovered", "the fault is cleared; the arm continues when the person is far enough away")
            )
        state = STOPPED if scale == 0.0 else FREE if scale == 1.0 else SLOWED
        if state != self._state:
            events.append(DecisionEvent(_KINDS[state], reason))
        if violation and not self._violated and part is not None:
            near = f"{part.person_link} is {-part.margin:.3f} m nearer to {part.robot_link} than permitted"
            events.append(DecisionEvent("violation", f"{near} while the arm moves"))
        if is_moved and not self._moved:
            events.append(DecisionEvent("moved", "the arm must stand still, but something else moves it"))
        self._state, self._fault, self._violated, self._moved = state, fault, violation, is_moved
        return events

    # -- modes ---------------------------------------------------------------------------------------------------------

    def _allowed(
        self, arm: ArmState, placed: PlacedCapsules, person: Observation, near: CapsuleNearness, less: float
    ) -> Permitted:
        """Return the limits that the mode permits, as if the person were nearer by `less` [m]."""
        mode, distance = self.settings.mode, near.distance - less
        by_distance = self._protective.permitted(distance, near.person_speed, self._speed)
        if mode == HAND_GUIDED:
            return self._guided(person, distance, near.person_speed)
        if mode == POWER_AND_FORCE:
            return self._expected(self._by_contact(arm, placed, person, near, by_distance), distance)
        if mode == STANDSTILL:
            by_distance = np.where(by_distance < 1.0, 0.0, 1.0)
        worst = int(np.argmin(by_distance))
        return self._expected(Permitted(float(by_distance[worst]), worst), distance)

    def _expected(self, permitted: Permitted, distance: FloatArray) -> Permitted:
        """Return the limits, lowered to the speed that the person expects; distance: of the parts from the arm [m]."""
        if not self.settings.expected:
            return permitted
        speeds = expected_speed(self.settings.expected, distance)
        part = int(np.argmin(speeds))
        scale = float(speeds[part]) / self._speed
        if scale >= permitted.scale:
            return permitted
        reason = f"a person at {distance[part]:.2f} m expects at most {speeds[part]:.2f} m/s"
        return permitted._replace(scale=scale, part=part, reason=reason)

    def _by_contact(
        self, arm: ArmState, placed: PlacedCapsules, person: Observation, near: CapsuleNearness, by_distance: FloatArray
    ) -> Permitted:
        """Return limits with which each body part is far enough away, or the arm slow enough for contact with it."""
        worst = int(np.argmin(by_distance))
        if by_distance[worst] >= 1.0:
            return Permitted(1.0, worst)
        link, point = placed.links[int(near.arm[worst])], near.robot_point[worst]
        masses = self._mechanism.robot_masses(arm.q, link, point, near.direction[worst])
        mass = masses.judged(self.settings.robot_mass) if masses.locked > 0.0 else math.inf
        speeds = np.array([self._contact_speed(regions, mass) for regions in person.regions])
        slow = np.clip((speeds - near.person_speed) / self._speed, 0.0, 1.0)
        both = np.maximum(by_distance, np.where(slow < SCALES[0], 0.0, slow))
        part = int(np.argmin(both))
        nearest = person.regions[int(np.argmin(near.distance))]
        return Permitted(
            float(both[part]),
            part,
            float(speeds[part]),
            self.settings.contact_stiffness,
            self._limits.held_force(nearest),
        )

    def _contact_speed(self, regions: Sequence[str], mass: float) -> float:
        """Return the lowest permitted contact speed of some regions [m/s]; 0 if contact is not permitted.

        mass: mass of the arm [kg].
        """
        if not regions or not math.isfinite(mass):
            return 0.0
        try:
            area = self.settings.contact_area
            return min(float(speed_limit(self._limits, region, mass, area).transient) for region in regions)
        except NotAssessableError:
            return 0.0

    def _guided(self, person: Observation, distance: FloatArray, towards: FloatArray) -> Permitted:
        """Return the limits for hand guiding: all body parts but the guiding arm must be far enough away."""
        settings = self.settings
        hands = [at for at, regions in enumerate(person.regions) if HAND in regions]
        at_arm = [at for at in hands if distance[at] <= settings.guided_distance]
        limits = math.nan, settings.guided_stiffness, settings.guided_force
        if not at_arm:
            return Permitted(0.0, int(np.argmin(distance)), *limits, "no guiding hand is at the arm")
        sides = {person.links[at].partition("_")[0] for at in at_arm if "_" in person.links[at]}
        leading = [link.partition("_")[0] in sides and _is_arm(link) for link in person.links]
        leading = [is_so or at in at_arm for at, is_so in enumerate(leading)]
        share = min(1.0, settings.guided_speed / self._speed)
        others = np.where(leading, 1.0, self._protective.permitted(distance, towards, settings.guided_speed))
        part = int(np.argmin(others))
        return Permitted(share * float(others[part]), part, *limits)

    def _reason(
        self, scale: float, allowed: Permitted, placed: PlacedCapsules, person: Observation, near: CapsuleNearness
    ) -> str:
        part = allowed.part
        where = f"{person.links[part]} is {near.distance[part]:.2f} m from {placed.links[int(near.arm[part])]}"
        waits = " and was nearer shortly before" if scale < allowed.scale else ""
        return f"{where}{waits}: {100.0 * scale:.0f} % of the speed"


def _is_arm(link: str) -> bool:
    return link.partition("_")[2] in ("shoulder", "elbow", "wrist")


def _part(
    placed: PlacedCapsules, person: Observation, near: CapsuleNearness, human: FloatArray, terms: Terms
) -> NearestPart:
    margins = near.distance - terms.total
    at = int(np.argmin(margins))
    nearest = Terms(*(float(np.broadcast_to(term, margins.shape)[at]) for term in terms))
    ax, ay, az = near.robot_point[at].tolist()
    bx, by, bz = near.person_point[at].tolist()
    return NearestPart(
        nearest,
        float(margins[at]),
        float(near.robot_speed[at]),
        float(human[at]),
        placed.links[int(near.arm[at])],
        person.links[at],
        ", ".join(person.regions[at]),
        (ax, ay, az),
        (bx, by, bz),
    )
