"""Execution of one approach, with assessment of its contacts."""

import math
from dataclasses import dataclass, field
from typing import Any

from hric_assessment.contact.limits import PARTED
from hric_core.errors import FailureError
from hric_msgs.msg import RegionContacts
from hric_run.simulation import Simulation
from hric_sweep.approaches.draw import LONGEST, Approach
from hric_sweep.approaches.meetings import ContactEvent
from hric_sweep.observed import Observed
from hric_sweep.outputs import IMPACT, SUPERVISION

EXPERIMENT = "shared_workspace"
CHUNK = 0.05
"""Robot time between two checks whether the run is over [s]."""


@dataclass
class Outcome:
    """Result of an approach.

    Attributes:
        seed, speed, bearing: values of the `Approach`.
        supervised: True if the supervisor acted.
        duration: duration of the run [s].
        separation: smallest distance between person and arm [m].
        violations: decisions in which the arm moved below the protective distance.
        stopped, slowed: shares of the time [1].
        contacts: contact events in the order in which they began.
        error: reason why the arm ended its motion; empty: it did not.
        failure: reason why the run was not completed, so that its contacts are unknown; empty: it was completed.
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
    contacts: list[ContactEvent] = field(default_factory=list)
    error: str = ""
    failure: str = ""

    def met(self, *arm: str) -> list[ContactEvent]:
        """Return the contacts that began while the arm was in one of these states."""
        return [contact for contact in self.contacts if contact.arm in arm]


class Runner:
    """Runner of successive approaches in one simulation.

    Args:
        simulator: name of the engine.
        supervised: True if the supervisor acts; otherwise it only monitors.
        changes: further overrides.
    """

    def __init__(self, simulator: str = "mujoco", supervised: bool = True, **changes: Any) -> None:
        self._overrides = {"simulator": simulator, "supervisor.active": supervised, **changes}
        self._supervised = supervised
        self._simulation: Simulation | None = None

    def run(self, approach: Approach) -> Outcome:
        """Run one approach until the first contact has ended or has lasted LONGEST, or else to its end."""
        simulation = self._begin(approach)
        observed, touched = Observed(simulation, {IMPACT, SUPERVISION}), list[float]()

        def on_contacts(message: RegionContacts) -> None:
            if message.touching:
                touched.append(simulation.time)

        simulation.node.subscribe("hric/human/contacts", RegionContacts, on_contacts)
        try:
            while not _over(simulation.time, approach.duration, touched):
                simulation.run(CHUNK)
        except FailureError as failure:  # the next approach gets a new simulation
            self.close()
            self._simulation = None
            return Outcome(
                approach.seed, approach.speed, approach.bearing, self._supervised, simulation.time, failure=str(failure)
            )
        return self._outcome(approach, simulation, observed)

    def _begin(self, approach: Approach) -> Simulation:
        if self._simulation is None:
            self._simulation = Simulation(EXPERIMENT, seed=approach.seed, **self._overrides, **approach.changes())
        else:
            self._simulation.reset(seed=approach.seed, **approach.changes())
        return self._simulation

    def _outcome(self, approach: Approach, simulation: Simulation, observed: Observed) -> Outcome:
        outcome = Outcome(approach.seed, approach.speed, approach.bearing, self._supervised, simulation.time)
        outcome.error = simulation.app.hw.error
        values = observed.values()
        if (seen := values[SUPERVISION]) is not None:
            outcome.separation, outcome.violations = seen["separation"], int(seen["violations"])
            outcome.stopped, outcome.slowed = seen["stopped"], seen["slowed"]
        outcome.contacts = values.contacts
        return outcome

    def close(self) -> None:
        """Close the simulation."""
        if self._simulation is not None:
            self._simulation.close()


def _over(time: float, end: float, touched: list[float]) -> bool:
    """Return True if a run is over; `touched`: robot times of all messages with a contact so far [s]."""
    if not touched:
        return time >= end - 1e-9
    return time > touched[-1] + PARTED + CHUNK or time >= touched[0] + LONGEST
