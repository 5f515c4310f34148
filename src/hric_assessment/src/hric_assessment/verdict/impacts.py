"""Impacts of contacts in closed form, and the approach speeds that the masses of the robot permit."""

from collections.abc import Mapping, Sequence

import numpy as np

from hric_assessment.contact.assess import ContactSite, LimitRatio, approach_ratio
from hric_assessment.contact.impact import ClosedFormImpact, ClosedFormModels
from hric_assessment.contact.mass import LARGEST, LOCKED, REFLECTED, STANDARD, RobotMasses
from hric_assessment.contact.speed import SpeedLimit, permitted_speed, speed_limit
from hric_assessment.findings import NotAssessableError
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.inputs import AssessmentInput
from hric_bags.records.human_record import HumanRecord
from hric_bags.run_file import held_mass
from hric_core.errors import HricError
from hric_human.contact import RegionContact

UNBOUNDED = 1e12
"""Mass assumed for a robot whose mass is not known [kg]: practically infinite, the worst case."""
MASS_TEXTS = {
    LARGEST: "largest of three masses",
    REFLECTED: "reflected mass",
    STANDARD: "M/2 + m_L",
    LOCKED: "mass with locked joints",
}
"""Short descriptions of the masses of the robot by which a contact can be judged."""
PERMITTED = tuple(f"permitted speed by {mass} [m/s]" for mass in ("m_u", "M/2 + m_L", "locked joints"))
"""Names of the speeds that the robot's three masses permit, in the order of `RobotMasses`."""
Impact = tuple[ClosedFormImpact, RobotMasses]
"""Closed form of an impact as simulated, and the masses of the robot by which it can be judged."""


class ExpectedImpacts:
    """Closed-form impacts (two masses and a spring) of recorded contacts, and the permitted approach speeds.

    Args:
        source: recording with the files next to it.
        record: recorded signals of the person.
        choices: choices with the limits.
    """

    def __init__(self, source: AssessmentInput, record: HumanRecord, choices: AssessmentChoices) -> None:
        self._limits, self._which, self._forms = choices.limits, choices.robot_mass, None
        self._why = "for the closed form: a control log"
        log = source.recording.log
        if log is None or not len(record.time):
            return
        if not source.description or not source.definition.get("human"):
            self._why = "for the closed form: the robot's description and the person's position (run folder)"
            return
        try:
            self._forms = ClosedFormModels(source.run, source.description, log, record, choices.factors)
        except HricError as error:
            self._why = f"for the closed form: {error}"
            return
        self._load = held_mass(source.definition)

    def form(self, contact: RegionContact) -> ClosedFormImpact | None:
        """Return the closed form of a contact; None: it has none, or the motion at that time is not known."""
        form = None if self._forms is None else self._forms.impact(contact)
        return form if form is not None and np.isfinite(form.peak) else None

    def approach(
        self, contacts: Sequence[RegionContact], site: ContactSite, simulated: bool
    ) -> tuple[LimitRatio | None, Impact | None, list[str]]:
        """Return the worst approach speed of some contacts with its limit, its impact, and doubts; None: not known.

        Args:
            contacts: contacts of an episode.
            site: place of the contacts.
            simulated: True if a simulation was recorded, which states the approach speed of each contact.
        """
        unknown = [
            contact for contact in contacts if contact.begin_speed is None or not np.isfinite(contact.begin_speed)
        ]
        placed = any(contact.begin_point is not None for contact in unknown)
        doubts = ["the approach speed is not known"] if unknown and (simulated or placed) else []
        approaches = []
        for contact in contacts:
            speed = (
                0.0 if contact.begin_speed is None else abs(contact.begin_speed)
            )  # the speed is negative if the bodies separate when the contact is first reported
            if not speed > 0.0:
                continue
            form, impact = self.form(contact), None
            if self._forms is not None and form is not None:
                impact = form, self._forms.robot_masses(contact, self._load)
            if (limit := self._lowest(impact, site)) is not None:
                label = f"{limit.region}, {'robot of unknown mass' if impact is None else MASS_TEXTS[self._which]}"
                approaches.append((approach_ratio(speed, float(limit.transient), label, impact is not None), impact))
        worst = max(approaches, key=lambda pair: pair[0].value / max(pair[0].limit, 1e-9), default=(None, None))
        return *worst, doubts

    def _lowest(self, impact: Impact | None, site: ContactSite) -> SpeedLimit | None:
        """Return the lowest permitted approach speed of the regions; None: no region has one.

        The robot has the mass that the user chose, or UNBOUNDED if the impact has no closed form.
        """
        mass = UNBOUNDED if impact is None else impact[1].judged(self._which)
        try:
            area, hand = site.contact_area, site.dominant
            limits = [speed_limit(self._limits, region, mass, area, hand) for region in site.permitted_regions]
        except NotAssessableError:
            return None
        return min(limits, key=lambda limit: float(limit.transient), default=None)

    def values(
        self, impact: Impact | None, site: ContactSite
    ) -> tuple[Mapping[str, float | None], tuple[str, ...], tuple[str, ...]]:
        """Return values, notes and missing data about the closed form, for a finding."""
        if self._forms is None:
            return {}, (), (self._why,)
        if impact is None:
            return {}, (), ()
        form, masses = impact
        values: dict[str, float | None] = {
            "speed at contact [m/s]": form.speed,
            "reflected mass of the robot m_u [kg]": masses.reflected,
            "M/2 + m_L [kg]": masses.standard,
            "mass of the robot with locked joints [kg]": masses.locked,
            "reflected mass of the body as simulated [kg]": form.human_mass,
            "v sqrt(mu k) as simulated [N]": form.peak,
        }
        if not site.regions:
            return values, (), ()
        try:
            limits = [speed_limit(self._limits, region, np.array(masses), site.contact_area) for region in site.regions]
        except NotAssessableError as error:
            return values, (f"no permitted speed: {error}",), ()
        limit = min(limits, key=lambda limit: float(np.min(limit.transient)))
        speeds = [float(speed) for speed in limit.transient]
        values |= dict(zip(PERMITTED, speeds, strict=True))
        if (force := limit.force_transient) is not None and limit.region in site.permitted_regions:
            values["speed at the limit, masses as simulated [m/s]"] = float(
                permitted_speed(force, form.mass, form.stiffness)
            )
        note = (
            f"closed form, {limit.region}: the reflected mass m_u of {masses.reflected:.2f} kg (with rotors, as "
            f"simulated) permits {speeds[0]:.3f} m/s; the standard's estimate M/2 + m_L of {masses.standard:.2f} kg "
            f"permits {speeds[1]:.3f} m/s; the mass with locked joints of {masses.locked:.2f} kg permits "
            f"{speeds[2]:.3f} m/s; judged by {MASS_TEXTS[self._which]}, {masses.judged(self._which):.2f} kg"
        )
        return values, (note,), ()
