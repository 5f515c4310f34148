"""Running an approach, and what came of it."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hric_assessment.contact.limits import Limits
from hric_assessment.supervisor.arm import ArmShape, ArmState
from hric_assessment.supervisor.separation import STANDING
from hric_assessment.tables import limit_table
from hric_control.geometry import FloatArray
from hric_experiments.approaches.draw import Approach
from hric_experiments.simulation import Simulation
from hric_msgs.msg import RegionContacts, SafetyState

EXPERIMENT = "shared_workspace"
CHUNK = 0.05
"""Between two looks at whether it is over [s]."""
AFTER = 0.15
"""A run goes on for so long after the first contact [s]: as long as the blow of an arm."""
MOVING, STANDING_ARM, PUSHED = "moving", "standing", "pushed"
"""How the arm was as a contact began: moving; standing; or to stand, and moved by a contact before."""


@dataclass(frozen=True)
class Met:
    """A contact.

    Attributes:
        time: of its begin [s].
        link, other: that met.
        region: of ISO/TS 15066.
        arm: moving, standing or pushed.
        arm_speed: of the arm's fastest place 2 ms before [m/s].
        speed: at which both met [m/s].
        peak: force [N].
        share: of the limit of a transient contact; infinite where none is permitted; NaN: the region has no limit.
    """

    time: float
    link: str
    other: str
    region: str
    arm: str
    arm_speed: float
    speed: float
    peak: float
    share: float

    @property
    def above(self) -> bool:
        """Whether it is above the limit, or has none that could be held against it."""
        return not self.share <= 1.0


@dataclass
class Outcome:
    """Of an approach.

    Attributes:
        seed, speed, bearing: as drawn.
        supervised: whether the supervisor acted.
        duration: of the run [s].
        separation: smallest [m].
        violations: decisions in which the arm moved nearer than it should.
        stopped, slowed: shares of the time.
        contacts: that began.
        error: why the arm ended its motion; empty: it did not.
    """

    seed: int
    speed: float
    bearing: float
    supervised: bool
    duration: float = 0.0
    separation: float = math.inf
    violations: int = 0
    stopped: float = 0.0
    slowed: float = 0.0
    contacts: list[Met] = field(default_factory=list)
    error: str = ""

    def above(self, arm: str) -> list[Met]:
        """Contacts above limits in which the arm was so."""
        return [met for met in self.contacts if met.arm == arm and met.above]


class Runner:
    """Runs approaches one after the other in one simulation.

    Args:
        simulator: engine.
        supervised: whether the supervisor acts; otherwise it watches.
        changes: further overrides.
    """

    def __init__(self, simulator: str = "mujoco", supervised: bool = True, **changes: Any) -> None:
        self._given = {"simulator": simulator, "supervisor.active": supervised, **changes}
        self._supervised, self._limits = supervised, Limits(limit_table())
        self._simulation: Simulation | None = None
        self._shape: ArmShape | None = None

    def run(self, approach: Approach) -> Outcome:
        """One approach."""
        simulation = self._begin(approach)
        states: list[Any] = []
        contacts: dict[tuple[str, str, float], Any] = {}

        def on_contacts(message: Any) -> None:
            for contact in (*message.touching, *message.ended):
                contacts[contact.link, contact.other, round(contact.begin, 6)] = contact

        simulation.node.subscribe("hric/human/contacts", RegionContacts, on_contacts)
        simulation.node.subscribe("hric/safety/state", SafetyState, states.append)
        end = approach.duration
        while simulation.time < end - 1e-9:
            simulation.run(min(CHUNK, end - simulation.time))
            if contacts:
                end = min(end, simulation.time + AFTER) if len(contacts) and end == approach.duration else end
        return self._outcome(approach, simulation, states, list(contacts.values()))

    def _begin(self, approach: Approach) -> Simulation:
        if self._simulation is None:
            self._simulation = Simulation(EXPERIMENT, seed=approach.seed, **self._given, **approach.changes())
        else:
            self._simulation.reset(seed=approach.seed, **approach.changes())
        return self._simulation

    def _outcome(self, approach: Approach, simulation: Simulation, states: list[Any], contacts: list[Any]) -> Outcome:
        log = simulation.signals
        if self._shape is None:
            self._shape = ArmShape(simulation.node.param("robot_description"), log.joint_names)
        found = Outcome(approach.seed, approach.speed, approach.bearing, self._supervised, simulation.time)
        found.error = simulation.app.hw.error
        if states:
            found.separation = float(np.nanmin([state.separation for state in states]))
            found.violations = sum(state.violation for state in states)
            found.stopped = float(np.mean([state.state == "stopped" for state in states]))
            found.slowed = float(np.mean([state.state == "slowed" for state in states]))
        first = math.inf
        for contact in sorted(contacts, key=lambda one: one.begin):
            speed = self._arm_speed(log, contact.begin - 0.002)
            arm = STANDING_ARM if speed < STANDING else MOVING
            if arm == MOVING and first < contact.begin - 0.002 and self._stood(log, first - 0.002):
                arm = PUSHED
            first = min(first, contact.begin)
            found.contacts.append(self._met(contact, arm, speed))
        return found

    def _stood(self, log: Any, time: float) -> bool:
        """Whether the arm stood at a time [s]: it moves later because of what touched it then."""
        return self._arm_speed(log, time) < STANDING

    def _arm_speed(self, log: Any, time: float) -> float:
        at = int(np.clip(np.searchsorted(log.time, time), 0, len(log.time) - 1))
        assert self._shape is not None, "made before"
        velocities: FloatArray = self._shape.at(ArmState(time, log.position[at], log.velocity[at])).velocities
        return float(np.linalg.norm(velocities, axis=2).max())

    def _met(self, contact: Any, arm: str, arm_speed: float) -> Met:
        regions = list(contact.regions)
        limit = self._limits.at(regions, dominant=contact.dominant) if regions else None
        if limit is None or not math.isfinite(contact.peak):
            share = math.nan
        else:
            transient = limit.force.transient if limit.permitted else None
            share = math.inf if transient is None else contact.peak / transient
        return Met(
            contact.begin,
            contact.link,
            contact.other,
            ", ".join(regions),
            arm,
            arm_speed,
            contact.begin_speed,
            contact.peak,
            share,
        )

    def close(self) -> None:
        """Release the simulation."""
        if self._simulation is not None:
            self._simulation.close()
