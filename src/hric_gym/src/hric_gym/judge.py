"""Costs of a step by the rules of hric_assessment, `tasks.COSTS`, as shares of their limits."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hric_assessment.contact.assess import ContactSite, assess
from hric_assessment.contact.episodes import PENALTY, episodes
from hric_assessment.contact.limits import Limits
from hric_assessment.ergonomics.instant import InstantScore
from hric_assessment.ergonomics.rula import Rula
from hric_assessment.findings import Finding, Outcome
from hric_control.sim.simulated_robot import SimulatedRobot
from hric_core.geometry import FloatArray
from hric_gym.tasks import COSTS, EFFORT, FORCE, POSTURE, SEPARATION, STOPPING
from hric_human.contact import ContactSeries, RegionContact, RegionContacts
from hric_human.participant.settings import HUMAN, HumanSettings
from hric_run.observation import SimulationState
from hric_supervisor.arm import InForce
from hric_supervisor.separation import Protective, StoppingModel, nearness
from hric_supervisor.settings import SupervisorSettings

TRUNK = "trunk_flex"
"""Joint of a body with a trunk, without which the posture is not known."""
TINY = 1e-9
"""Distance that replaces distances of zero or less as divisor [m]."""


@dataclass(frozen=True)
class Costs:
    """Costs of one step.

    Attributes:
        shares: each known cost as share of its limit [1], by name; above 1 it violates the limit.
        violations: names of the costs that are above their limits, or not proven to be within them.
        not_known: names of the costs that are not known, such as the posture of a body without a trunk.
        findings: a sentence about each contact that is above its limit, or not proven to be within it.
    """

    shares: dict[str, float] = field(default_factory=dict)
    violations: tuple[str, ...] = ()
    not_known: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()

    @classmethod
    def worst(cls, parts: Sequence["Costs"]) -> "Costs":
        """Return the largest costs of the parts of a step; a cost has to be known in all of them."""
        if len(parts) == 1:
            return parts[0]
        violations, unknown = (
            {name for part in parts for name in getattr(part, key)} for key in ("violations", "not_known")
        )
        return cls(
            {name: max(part.shares[name] for part in parts) for name in parts[0].shares if name not in unknown},
            tuple(name for name in COSTS if name in violations),
            tuple(name for name in COSTS if name in unknown),
            tuple(dict.fromkeys(text for part in parts for text in part.findings)),
        )


class ContactWatch:
    """Recorder of the person's contacts in each cycle, which compares them with the limits of hric_assessment.

    Args:
        hw: the simulated robot.
        settings: section `human` of the experiment.
    """

    def __init__(self, hw: SimulatedRobot, settings: HumanSettings) -> None:
        self._hw, self._area, self._body = hw, settings.contact_area, settings.body()
        self._limits = Limits.named()
        self.restart()
        hw.loop.after_cycle.append(self._record)

    def restart(self) -> None:
        """Delete all recorded contacts; to be called after each reset."""
        self._contacts = RegionContacts(self._body, HUMAN)
        self._rows: dict[int, tuple[RegionContact, list[tuple[float, ...]]]] = {}
        self._touched: set[int] = set()

    def _record(self, time: float) -> None:
        contacts = self._hw.plant.contacts()
        if not (contacts or self._contacts.present):
            return
        now = time + self._hw.loop.time_step
        self._contacts.update(now, contacts)
        for contact in self._contacts.present.values():
            key = id(contact)
            force, peak, peak_time = (
                math.nan if value is None else value for value in (contact.force, contact.peak, contact.peak_time)
            )
            row = (now, force, peak, peak_time, now - contact.begin, *(contact.point or ()), *(contact.normal or ()))
            self._rows.setdefault(key, (contact, []))[1].append(row)
            self._touched.add(key)

    def findings(self) -> list[Finding]:
        """Return a finding for each contact that was present since the last call, over its time from start to now."""
        touched, self._touched = self._touched, set()
        groups: dict[tuple[tuple[str, ...], str, str], list[RegionContact]] = {}
        for key in touched:
            contact, rows = self._rows[key]
            columns = np.array(rows)
            time, force, reached, reached_time, since = columns[:, :5].T
            series = ContactSeries(time, force, reached, reached_time, since, columns[:, 5:8], columns[:, 8:11])
            groups.setdefault((contact.regions, contact.side, contact.kind), []).append(
                replace(contact, series=series, ended=True)
            )
        return [finding for contacts in groups.values() for finding in self._judged(contacts)]

    def _judged(self, contacts: list[RegionContact]) -> Iterable[Finding]:
        first, until = contacts[0], self._hw.loop.time
        site = ContactSite(first.regions, first.other, first.kind, None, first.dominant, self._area)
        if first.kind != PENALTY:
            return [assess(None, site, self._limits)]
        return [assess(part, site, self._limits) for part in episodes(contacts, self._hw.loop.time_step, until)]


class Judge:
    """Computation of the costs of each step of an environment.

    Args:
        hw: the simulated robot.
        settings: section `human` of the experiment.
    """

    def __init__(self, hw: SimulatedRobot, settings: HumanSettings) -> None:
        self._watch, joints = ContactWatch(hw, settings), tuple(settings.body().joints)
        self._score = InstantScore(Rula(), joints, "right", "left") if TRUNK in joints else None
        supervision = SupervisorSettings()
        self._stopping = StoppingModel(supervision)
        self._protective = Protective(supervision, self._stopping)
        self._before: tuple[float, FloatArray] | None = None

    def restart(self) -> None:
        """Delete the data of the last episode; to be called after each reset."""
        self._watch.restart()
        self._before = None

    def costs(self, observation: SimulationState) -> Costs:
        """Return the costs of the time since the last call; `observation`: state at its end."""
        person = observation.person
        assert person is not None, "the judge has a person"
        findings = self._watch.findings()
        poor = [finding for finding in findings if finding.outcome != Outcome.WITHIN]
        shares = {FORCE: max((math.inf if item.share is None else item.share for item in findings), default=0.0)}
        shares[SEPARATION], shares[STOPPING] = self._separation(observation)
        effort = max((share for share in person.strength_share.tolist() if not math.isnan(share)), default=math.nan)
        if math.isfinite(effort):
            shares[EFFORT] = effort
        if self._score is not None:
            # Loads and repetitions, which the simulation does not know, count as favourable: a lower bound.
            shares[POSTURE] = self._score(person.q.tolist()) / Rula().table().warning.value
        over = {name for name, share in shares.items() if share > 1.0} | ({FORCE} if poor else set())
        return Costs(
            shares,
            tuple(name for name in COSTS if name in over),
            tuple(name for name in COSTS if name not in shares),
            tuple(f"{finding.subject}: {finding.outcome}: {finding.reason}" for finding in poor),
        )

    def _separation(self, observation: SimulationState) -> tuple[float, float]:
        """Return the largest ratios of protective separation and of stopping distance to distance [1].

        In a contact, the first is infinite, and the second is very large if the arm moves towards the person.
        """
        person, rows = observation.person, observation.nearest
        assert person is not None and rows is not None
        ends = person.capsules.ends
        before, self._before = self._before, (observation.time, ends)
        velocities = np.zeros_like(ends) if before is None else (ends - before[1]) / (observation.time - before[0])
        arm = observation.arm.capsules
        near = nearness(arm, velocities, rows)
        braking = self._stopping.left(observation.time, observation.time, InForce(), arm.fastest)
        _, terms = self._protective.measured(near, braking)
        separation = stopping = 0.0
        for distance, total, robot in zip(
            near.distance.tolist(),
            terms.total.tolist(),
            np.add(terms.reaction, terms.stopping).tolist(),
            strict=True,
        ):
            divisor = distance if distance > TINY else TINY  # also for a distance that is not a number
            separation = max(separation, total / divisor if distance > 0.0 else math.inf)
            stopping = max(stopping, robot / divisor)
        return separation, stopping
