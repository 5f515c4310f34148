"""Choices of the user for an assessment: limits, braking of the arm, contact area; with their command line options."""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hric_assessment.contact.area import check_area
from hric_assessment.contact.classes import BY_DURATION, INTERPRETATIONS
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.mass import LARGEST, ROBOT_MASSES
from hric_assessment.ergonomics.scoring import methods
from hric_assessment.separation.protective import Stop
from hric_assessment.separation.stopping import StopTable, load
from hric_assessment.tables import AREA, LIMIT_TABLES, REACTION, STOPPING, verdict_table
from hric_assessment.typed_json import Content
from hric_assessment.work import Work
from hric_assessment.work import load as load_work
from hric_core.command import Argument
from hric_core.geometry import FloatArray
from hric_core.parameters import as_number

AREA_OPTION = "--contact-area"


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
        work: what the user states about the work.
    """

    limits: Limits = field(default_factory=Limits.named)
    braking: BrakingChoice = field(default_factory=BrakingChoice)
    contact_area: float | None = None
    robot_mass: str = LARGEST
    versions: Mapping[str, str] = field(default_factory=dict)
    assumptions: tuple[str, ...] = ()
    interpretation: str = BY_DURATION
    factors: Mapping[str, float] = field(default_factory=dict)
    work: Work = field(default_factory=Work)

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


def choice_arguments() -> list[Argument]:
    """Return the command line options that set `AssessmentChoices`."""
    return [
        Argument(
            "--limits",
            default=LIMIT_TABLES[0],
            metavar="FILE|bgia2011",
            help=f"contact limits: {', '.join(LIMIT_TABLES)} (default: {LIMIT_TABLES[0]}), or a YAML file of your own",
        ),
        Argument(
            "--contact-class",
            choices=INTERPRETATIONS,
            default=BY_DURATION,
            help="interpretation of clamped contacts: by_duration, transient limits for the first half second of every "
            "contact (default); by_clamping, quasi-static limits from the begin if the body part is clamped",
        ),
        Argument(
            "--stop",
            type=Path,
            metavar="FILE",
            help="YAML file with stopping times and distances of the arm by speed and load, from your measurements or "
            "from hric measure_stops (simulation); default: an assumption, which is printed",
        ),
        Argument(
            AREA_OPTION,
            type=float,
            metavar="M2",
            help="contact area, the smaller of the robot's and the body's [m^2] (1 cm^2 is 1e-4); without it or "
            "human.contact_area in the experiment, no contact is within limits, since its pressure is not known",
        ),
        Argument(
            "--robot-mass",
            choices=ROBOT_MASSES,
            default=LARGEST,
            help="mass of the robot by which the speed of a contact is judged: reflected, with rotors and free joints; "
            "standard, M/2 + m_L; locked, with locked joints; or the largest of the three (default: %(default)s)",
        ),
        Argument(
            "--work",
            type=Path,
            metavar="FILE",
            help="YAML file with lifts, pushing and repetitive work, their loads and breaks, which are then judged",
        ),
        *_table_arguments(),
    ]


def _table_arguments() -> list[Argument]:
    return [
        Argument(
            f"--{key}-table",
            choices=method.versions,
            default=method.versions[0],
            help=f"version of {method.table().title}'s table A",
        )
        for key, method in methods().items()
        if len(method.versions) > 1
    ]


def chosen(options: argparse.Namespace) -> AssessmentChoices:
    """Return the choices that the options of `choice_arguments` set. Raises HricError."""
    limits = options.limits if options.limits in LIMIT_TABLES else Path(options.limits).expanduser()
    stops = None if options.stop is None else load(options.stop)
    if options.contact_area is not None:
        check_area(options.contact_area, name=AREA_OPTION)
    versions = {key: version for key in methods() if (version := getattr(options, f"{key}_table", ""))}
    return AssessmentChoices(
        Limits.named(limits),
        BrakingChoice(stops),
        options.contact_area,
        options.robot_mass,
        versions,
        interpretation=options.contact_class,
        work=Work() if options.work is None else load_work(options.work.expanduser()),
    )
