"""Parameters of the supervisor."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hric_assessment.contact.mass import ROBOT_MASSES
from hric_core.parameters import Settings, anything, choice, flag, listing, names, number, refuse_void, text
from hric_human.hand.startle import check_expected, expected_rows

SPEED_AND_SEPARATION, POWER_AND_FORCE = "speed_and_separation", "power_and_force_limiting"
HAND_GUIDED, STANDSTILL = "hand_guided", "monitored_standstill"
MODES = (SPEED_AND_SEPARATION, POWER_AND_FORCE, HAND_GUIDED, STANDSTILL)
HUMAN, MARKER, PERSON = "human", "marker", "person"
ACTS_WITH = {
    **dict.fromkeys(("guided_speed", "guided_distance", "guided_stiffness", "guided_force"), HAND_GUIDED),
    **dict.fromkeys(("contact_stiffness", "contact_area", "robot_mass"), POWER_AND_FORCE),
    **dict.fromkeys(("body", "hand_radius"), MARKER),
}
"""Parameters that have an effect only in one mode or with one source, with the name of that mode or source."""


@dataclass(frozen=True)
class SupervisorSettings(Settings):
    """Parameters of the supervisor in an experiment; defaults without a source are project defaults, unconfirmed."""

    separator = "."
    active: bool = flag(True, text="false: the supervisor only observes and reports, and does not slow the robot")
    mode: str = choice(
        *MODES, text='kind of collaborative operation: see INTERFACE.md of hric_supervisor, "How it decides"'
    )
    source: tuple[str, ...] = listing(
        choice(HUMAN, MARKER, PERSON),
        range(1, 4),
        HUMAN,
        different=True,
        single=True,
        text="source of the person's pose: `human`, joint states of the simulated human in the plant; `marker`, a hand "
        "tracked by motion capture as a rigid body; `person`, joints of a real person, tracked by the node `person`. "
        "With several sources the nearest person decides, and a fault of any source stops the arm",
    )
    body: tuple[str, ...] = names(
        default="hand", text="with `marker`: rigid body of the hand; each of several counts as another person"
    )
    hand_radius: float = number(
        0.15,
        above=0.0,
        maximum=1.0,
        unit="m",
        text="with `marker`: radius of the sphere around the tracked hand; nothing else of the person is observed",
    )
    limits: str = text("iso_ts_15066", empty=False, text="table of contact limits, or path of a file with limits")
    speed: float = number(
        1.0,
        above=0.0,
        unit="m/s",
        text="speed of the arm's fastest point at full speed scale; if a higher one is observed, that counts",
    )
    reaction_time: float = number(
        0.1, minimum=0.0, maximum=5.0, unit="s", text="T_r: time from the person's motion until the arm begins to brake"
    )
    settling_time: float = number(
        0.25,
        minimum=0.0,
        maximum=5.0,
        unit="s",
        text="lag of the controller: time from speed scale 0 until the arm is at rest",
    )
    stops: str = text(
        "",
        text='file of stops (see hric_assessment, "Stops") used instead of `settling_time`: T_s and S_s at its largest '
        "load, measured on this robot, whose name its `robot` has, while it stops by its speed scale; at least the "
        "time of the scale's ramp counts; empty: none",
    )
    intrusion: float = number(0.1, minimum=0.0, unit="m", text="intrusion distance C")
    person_uncertainty: float = number(0.05, minimum=0.0, unit="m", text="uncertainty Z_d of the person's position")
    robot_uncertainty: float = number(0.01, minimum=0.0, unit="m", text="uncertainty Z_r of the robot's position")
    hysteresis: float = number(
        0.05, minimum=0.0, unit="m", text="additional distance of the person before the arm may move faster again"
    )
    hold: float = number(
        0.3, minimum=0.0, maximum=60.0, unit="s", text="time for which the person must keep that distance"
    )
    max_age: float = number(
        0.08,
        above=0.0,
        maximum=5.0,
        unit="s",
        text="maximum age of data about person and arm; older data stops the arm. Choose it so that `max_age` + 2 / "
        "`rate` is at most `reaction_time`; then the arm stops in time if the person is no longer seen",
    )
    person_max_speed: float = number(
        10.0,
        above=0.0,
        unit="m/s",
        text="speed of a point of the person above which its data counts as faulty; five times the hand speed of "
        "ISO 13855",
    )
    person_hold: float = number(
        1.0,
        minimum=0.0,
        maximum=60.0,
        unit="s",
        text="time for which the person's data must be valid again after it was faulty",
    )
    contact_stiffness: float = number(
        200.0, above=0.0, unit="N/m", text="with `power_and_force_limiting`: maximum stiffness while the person is near"
    )
    contact_area: float | None = number(
        None,
        above=0.0,
        unit="m^2",
        text="with `power_and_force_limiting`: contact area, for limits of pressure; none: only limits of force count",
    )
    robot_mass: str = choice(
        *ROBOT_MASSES,
        text="with `power_and_force_limiting`: mass of the arm at the nearest point: `reflected` with rotors and free "
        "joints, the `standard`'s M/2 + m_L, the one with `locked` joints, or the `largest` of the three",
    )
    guided_speed: float = number(
        0.25, above=0.0, unit="m/s", text="with `hand_guided`: maximum speed of the arm (ISO 10218, from memory)"
    )
    guided_distance: float = number(
        0.15, above=0.0, unit="m", text="with `hand_guided`: maximum distance of the guiding hand from the arm"
    )
    guided_stiffness: float = number(100.0, above=0.0, unit="N/m", text="with `hand_guided`: maximum stiffness")
    guided_force: float = number(
        60.0, above=0.0, unit="N", text="with `hand_guided`: maximum spring force of Cartesian controllers"
    )
    expected: tuple[tuple[float, ...], ...] = expected_rows(
        "rows [distance of arm and person, highest speed of the arm's fastest point that the person expects there]: "
        "the arm is not faster, so that it does not startle them; beyond the last distance this sets no limit; without "
        "effect with `hand_guided`; empty: off"
    )
    rate: float = number(100.0, minimum=10.0, maximum=500.0, unit="Hz", text="rate of decisions")

    acknowledge_no_safety_function: bool = flag(
        False,
        text="true: you acknowledge that this is neither a certified safety function nor a protective stop; otherwise "
        "an arm whose address is not 127.* is refused",
    )

    def check(self, where: str) -> None:
        """Refuse parameters that have no effect with the chosen mode, source, or file of stops."""
        for name, word in ACTS_WITH.items():
            if word not in (self.mode, *self.source):
                refuse_void(self, name, where, f"{where}{'source' if word == MARKER else 'mode'}: {word}")
        check_expected(self.expected, f"{where}expected")
        if self.stops:
            refuse_void(self, "settling_time", where, f"no {where}stops")

    @property
    def table(self) -> str | Path:
        """Name of a limit table, or path of a file with limits."""
        return Path(self.limits) if self.limits.endswith((".yaml", ".yml")) else self.limits

    @property
    def persons(self) -> tuple[tuple[str, str], ...]:
        """Pairs (name, source) of the observed persons."""
        watched = [(name, source) for source in self.source for name in (self.body if source == MARKER else (source,))]
        return tuple(watched) if len(watched) > 1 else (("the person", self.source[0]),)


@dataclass(frozen=True)
class SupervisorNodeSettings(SupervisorSettings):
    """Parameters of the supervisor's node: those of an experiment, and the sections of the persons."""

    human: Any = anything(
        None, default_text="none", text="with `human`: section `human` of the experiment (body and pose of the person)"
    )
    person: Any = anything(
        None,
        default_text="none",
        text="with `person`: section `person` of the experiment. With source human, deprecated: used as `human` if "
        "that is not set; ends with the next release",
    )
