"""Parameters of the supervisor."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hric_core.parameters import Settings, anything, choice, flag, listing, names, number, refuse_void, text

SPEED_AND_SEPARATION, POWER_AND_FORCE = "speed_and_separation", "power_and_force_limiting"
HAND_GUIDED, STANDSTILL = "hand_guided", "monitored_standstill"
MODES = (SPEED_AND_SEPARATION, POWER_AND_FORCE, HAND_GUIDED, STANDSTILL)
HUMAN, MARKER, PERSON = "human", "marker", "person"
ACTS_WITH = {
    **dict.fromkeys(("guided_speed", "guided_distance", "guided_stiffness", "guided_force"), HAND_GUIDED),
    **dict.fromkeys(("contact_stiffness", "contact_area"), POWER_AND_FORCE),
    **dict.fromkeys(("body", "hand_radius"), MARKER),
}
"""Parameters that act in one mode, or with one source, alone."""


@dataclass(frozen=True)
class SupervisorSettings(Settings):
    """Parameters of an experiment's section; values without a source are project defaults, unconfirmed."""

    separator = "."
    active: bool = flag(True, text="false: it watches and reports, and the robot is left alone")
    mode: str = choice(*MODES, text="what keeps the person inside the limits: Supervisor, below")
    source: tuple[str, ...] = listing(
        choice(HUMAN, MARKER, PERSON),
        range(1, 4),
        HUMAN,
        different=True,
        single=True,
        text="who sees the person: `human`, the joint states of the one in the plant; `marker`, a hand whose rigid "
        "body motion capture tracks; `person`, the joints of a real one whom the node `person` tracks. Of several the "
        "nearest decides, and a fault of any stops the arm",
    )
    body: tuple[str, ...] = names(
        default="hand", text="with `marker`: rigid body of the hand; of several each is a person of their own"
    )
    hand_radius: float = number(
        0.15,
        above=0.0,
        maximum=1.0,
        unit="m",
        text="with `marker`: ball that holds the hand, and with it all that comes",
    )
    limits: str = text("iso_ts_15066", empty=False, text="table of limits, or a limit file's path")
    speed: float = number(
        1.0,
        above=0.0,
        unit="m/s",
        text="fastest place of the arm at full speed; a faster one that is seen takes its place",
    )
    reaction_time: float = number(
        0.1, minimum=0.0, maximum=5.0, unit="s", text="T_r: from the person's motion until the arm begins to brake"
    )
    settling_time: float = number(
        0.25,
        minimum=0.0,
        maximum=5.0,
        unit="s",
        text="by which the arm is at rest later than its speed scale: what its controller lags behind",
    )
    stops: str = text(
        "",
        text="file of stops (Stops, above) in place of `settling_time`: T_s and S_s of its largest load, measured as "
        "this robot stops with its speed scale; less than the scale needs does not count; empty: none",
    )
    intrusion: float = number(0.1, minimum=0.0, unit="m", text="C")
    person_uncertainty: float = number(0.05, minimum=0.0, unit="m", text="Z_d")
    robot_uncertainty: float = number(0.01, minimum=0.0, unit="m", text="Z_r")
    hysteresis: float = number(
        0.05, minimum=0.0, unit="m", text="that the person must be farther away to let it go faster"
    )
    hold: float = number(0.3, minimum=0.0, maximum=60.0, unit="s", text="for which that must last")
    max_age: float = number(
        0.08,
        above=0.0,
        maximum=5.0,
        unit="s",
        text="of what is known of person or arm; what is older stops the arm. With two periods of decisions it is "
        "within `reaction_time`, so that a person who vanishes stops the arm in time",
    )
    person_max_speed: float = number(
        10.0,
        above=0.0,
        unit="m/s",
        text="a point of the person that is faster cannot be: a fault; five times the speed of a hand by ISO 13855",
    )
    person_hold: float = number(
        1.0,
        minimum=0.0,
        maximum=60.0,
        unit="s",
        text="for which the person's data must be valid again after it could not be",
    )
    contact_stiffness: float = number(
        200.0, above=0.0, unit="N/m", text="with `power_and_force_limiting`: largest stiffness while the person is near"
    )
    contact_area: float | None = number(
        None, above=0.0, unit="m^2", text="likewise: of a contact, for limits of pressure; none: of force alone"
    )
    guided_speed: float = number(
        0.25, above=0.0, unit="m/s", text="with `hand_guided`: fastest place of the arm (ISO 10218, from memory)"
    )
    guided_distance: float = number(0.15, above=0.0, unit="m", text="likewise: of the guiding hand from the arm")
    guided_stiffness: float = number(100.0, above=0.0, unit="N/m", text="likewise: largest stiffness")
    guided_force: float = number(60.0, above=0.0, unit="N", text="likewise: largest force of a spring")
    rate: float = number(100.0, minimum=10.0, maximum=500.0, unit="Hz", text="of decisions")

    acknowledge_no_safety_function: bool = flag(
        False,
        text="that this is no certified safety function, and no protective stop; without it an arm whose address is "
        "not 127.* is refused",
    )

    def check(self, where: str) -> None:
        """Refuse what the mode and the source, or a file of stops, make void."""
        for name, word in ACTS_WITH.items():
            if word not in (self.mode, *self.source):
                refuse_void(self, name, where, f"{where}{'source' if word == MARKER else 'mode'}: {word}")
        if self.stops:
            refuse_void(self, "settling_time", where, f"no {where}stops")

    @property
    def table(self) -> str | Path:
        """Name or path for `hric_assessment.tables.limit_table`."""
        return Path(self.limits) if self.limits.endswith((".yaml", ".yml")) else self.limits

    @property
    def persons(self) -> tuple[tuple[str, str], ...]:
        """Pairs (name, source) of the watched persons."""
        watched = [(name, source) for source in self.source for name in (self.body if source == MARKER else (source,))]
        return tuple(watched) if len(watched) > 1 else (("the person", self.source[0]),)


@dataclass(frozen=True)
class SupervisorNodeSettings(SupervisorSettings):
    """Additional parameters of the node."""

    human: Any = anything(
        None, default_text="none", text="with `human`: that section of the experiment: who it is, and where"
    )
    person: Any = anything(
        None,
        default_text="none",
        text="with `person`: that section of the experiment; with `human` alone: as `human`, for one release",
    )
