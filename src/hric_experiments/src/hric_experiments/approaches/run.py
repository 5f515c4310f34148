"""Running an approach, and what came of it."""

import math
from dataclasses import dataclass, field
from typing import Any

from hric_experiments.approaches import meetings
from hric_experiments.approaches.draw import Approach
from hric_experiments.approaches.meetings import Met
from hric_experiments.simulation import Simulation
from hric_msgs.msg import RegionContacts, SafetyState

EXPERIMENT = "shared_workspace"
CHUNK = 0.05
"""Between two looks at whether it is over [s]."""
AFTER = 0.15
"""A run goes on for so long after the first contact [s]: as long as the blow of an arm."""


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
        self._supervised = supervised
        self._simulation: Simulation | None = None

    def run(self, approach: Approach) -> Outcome:
        """One approach."""
        simulation = self._begin(approach)
        states: list[Any] = []
        contacts: list[Any] = []
        simulation.node.subscribe(
            "hric/human/contacts", RegionContacts, lambda message: contacts.extend(meetings.listed([message]))
        )
        simulation.node.subscribe("hric/safety/state", SafetyState, states.append)
        end = approach.duration
        while simulation.time < end - 1e-9:
            simulation.run(min(CHUNK, end - simulation.time))
            if contacts:
                end = min(end, simulation.time + AFTER) if end == approach.duration else end
        return self._outcome(approach, simulation, states, contacts)

    def _begin(self, approach: Approach) -> Simulation:
        if self._simulation is None:
            self._simulation = Simulation(EXPERIMENT, seed=approach.seed, **self._given, **approach.changes())
        else:
            self._simulation.reset(seed=approach.seed, **approach.changes())
        return self._simulation

    def _outcome(self, approach: Approach, simulation: Simulation, states: list[Any], contacts: list[Any]) -> Outcome:
        found = Outcome(approach.seed, approach.speed, approach.bearing, self._supervised, simulation.time)
        found.error = simulation.app.hw.error
        if (seen := meetings.supervision(states)) is not None:
            found.separation, found.violations = seen["separation"], int(seen["violations"])
            found.stopped, found.slowed = seen["stopped"], seen["slowed"]
        found.contacts = meetings.of(contacts, simulation.signals, simulation.node.param("robot_description"))
        return found

    def close(self) -> None:
        """Release the simulation."""
        if self._simulation is not None:
            self._simulation.close()
