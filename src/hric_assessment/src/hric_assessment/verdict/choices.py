"""Choices of the user for an assessment: limits, braking of the arm, contact area."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hric_assessment.contact.classes import BY_DURATION
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.mass import LARGEST
from hric_assessment.separation.protective import Stop
from hric_assessment.separation.stopping import StopTable
from hric_assessment.tables import AREA, REACTION, STOPPING, verdict_table
from hric_assessment.typed_json import Content
from hric_core.geometry import FloatArray
from hric_core.parameters import as_number


@dataclass(frozen=True)
class BrakingChoice:
    """Assumed braking of the arm, for the protective distance.

    Attributes:
        stops: table of the arm's stops by speed and load; None: not known.
        reaction, stopping: factors of the reaction time, and of stopping time and distance [1].
    """

    stops: StopTable | None = None
    reaction: float = 1.0
    stopping: float = 1.0

    def text(self, load: float) -> str:
        """Return a text with the assumption about the braking, or its source; load: load of the arm [kg]."""
        rules = verdict_table()
        reaction, time = f"{rules['reaction_time']:g} s", f"{rules['stopping_time']:g} s"
        if self.stops is None:
            return (
                f"assumed: the arm reacts after {reaction} and stops within {time} from any speed (chosen here, since "
                "its braking is not known)"
            )
        return (
            f"{self.stops.name}, with {load:g} kg; perception takes {reaction} (chosen here), and the arm starts to "
            f"brake {self.stops.reaction_time:g} s later"
        )

    def stop(self, speed: FloatArray, load: float) -> Stop:
        """Return the stop from speeds of the arm, shape (n,) [m/s], with a load [kg].

        Raises:
            NotAssessableError: the speed or load is higher than in any known stop.
        """
        rules = verdict_table()
        reaction = self.reaction * rules["reaction_time"]
        if self.stops is None:
            return Stop(reaction, 0.0 * speed + self.stopping * rules["stopping_time"])
        stop = self.stops.stop(speed, load, reaction)
        distance = None if stop.distance is None else np.multiply(self.stopping, stop.distance)
        return stop._replace(time=np.multiply(self.stopping, stop.time), distance=distance)


@dataclass(frozen=True)
class AssessmentChoices:
    """Choices of the user for an assessment.

    Attributes:
        limits: contact limits.
        braking: braking of the arm.
        contact_area: area over which contacts act, the smaller of the robot's and the body's [m^2]; None: not known.
            If the recording has an area for a contact, the smaller of the two counts.
        robot_mass: mass of the robot by which contacts are judged, one of ROBOT_MASSES.
        interpretation: interpretation of clamped contacts, one of `contact.classes.INTERPRETATIONS`.
        versions: versions of the tables of posture scoring methods, by the keys of `methods`.
        assumptions: assumptions behind the choices, one sentence each.
        factors: factors of unconfirmed numbers, by their names in config/tables/uncertain.yaml; a missing one is 1.
    """

    limits: Limits = field(default_factory=Limits.named)
    braking: BrakingChoice = field(default_factory=BrakingChoice)
    contact_area: float | None = None
    robot_mass: str = LARGEST
    versions: Mapping[str, str] = field(default_factory=dict)
    assumptions: tuple[str, ...] = ()
    interpretation: str = BY_DURATION
    factors: Mapping[str, float] = field(default_factory=dict)

    def varied(self, factors: Mapping[str, float]) -> "AssessmentChoices":
        """Return a copy with unconfirmed numbers changed; the contact area must be known already, see `stated`.

        factors: factors by the names in config/tables/uncertain.yaml; a missing one is 1.
        """
        area = None if self.contact_area is None else factors.get(AREA, 1.0) * self.contact_area
        braking = replace(self.braking, reaction=factors.get(REACTION, 1.0), stopping=factors.get(STOPPING, 1.0))
        limits = self.limits.varied(factors)
        return replace(self, limits=limits, braking=braking, contact_area=area, factors=factors)

    def stated(self, experiment: Content) -> "AssessmentChoices":
        """Return a copy with the contact area that an experiment states, if the user chose none."""
        stated = (experiment.get("human") or {}).get("contact_area")
        if self.contact_area is not None or stated is None:
            return self
        area = as_number(stated)
        assumed = f"the contact area is {1e4 * area:g} cm^2, as the experiment states (human.contact_area)"
        return replace(self, contact_area=area, assumptions=(*self.assumptions, assumed))
