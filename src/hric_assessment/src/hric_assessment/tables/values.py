"""Tables of single values, as in their files."""

from collections.abc import Mapping
from dataclasses import dataclass

from hric_assessment.tables.base import Marked, Table, check_sources
from hric_core.parameters import listing, mapping, number, numbers, section


@dataclass(frozen=True)
class Value(Marked):
    """Single value."""

    value: float = number()


@dataclass(frozen=True)
class ValueTable(Table):
    """Table of single values."""

    def check(self, where: str) -> None:
        """Refuse sources that the file does not describe."""
        super().check(where)
        for name, row in self.values.items():
            check_sources(row.source, self.sources, f"{where}{name}")

    @property
    def values(self) -> dict[str, Value]:
        """Values by name."""
        return {name: value for name, value in vars(self).items() if isinstance(value, Value)}

    def __getitem__(self, name: str) -> float:
        """Return a value in its printed unit. Raises KeyError."""
        return self.values[name].value


@dataclass(frozen=True)
class NioshTable(ValueTable):
    """Values of the lifting equation; explained in config/tables/niosh.yaml."""

    load_constant: Value = section(Value)
    horizontal: Value = section(Value)
    horizontal_limit: Value = section(Value)
    vertical: Value = section(Value)
    vertical_slope: Value = section(Value)
    vertical_limit: Value = section(Value)
    distance_offset: Value = section(Value)
    distance_slope: Value = section(Value)
    distance: Value = section(Value)
    distance_limit: Value = section(Value)
    asymmetry_slope: Value = section(Value)
    asymmetry_limit: Value = section(Value)
    speed_limit: Value = section(Value)
    design_goal: Value = section(Value)
    high: Value = section(Value)
    couplings: Mapping[str, tuple[float, float]] = mapping(numbers(2, minimum=0.0, maximum=1.0))
    durations: tuple[float, ...] = numbers(3, unit="h", above=0.0)
    frequencies: tuple[tuple[float, ...], ...] = listing(numbers(7, minimum=0.0))


@dataclass(frozen=True)
class SeparationTable(ValueTable):
    """Default values of the protective separation distance; config/tables/separation.yaml."""

    walking_speed: Value = section(Value)
    hand_speed: Value = section(Value)
    near: Value = section(Value)
    intrusion_slope: Value = section(Value)
    intrusion_offset: Value = section(Value)
    resolution_limit: Value = section(Value)


@dataclass(frozen=True)
class EpisodeTable(ValueTable):
    """Rules for splitting contacts; config/tables/episodes.yaml."""

    transient_time: Value = section(Value)
    rate: Value = section(Value)
    touch_force: Value = section(Value)
    gap: Value = section(Value)


@dataclass(frozen=True)
class VerdictTable(ValueTable):
    """Rules without a published source; config/tables/verdict.yaml."""

    near_limit: Value = section(Value)
    rula_within: Value = section(Value)
    rula_warning: Value = section(Value)
    reba_within: Value = section(Value)
    reba_warning: Value = section(Value)
    lasting: Value = section(Value)
    angle: Value = section(Value)
    max_gap: Value = section(Value)
    held: Value = section(Value)
    lift: Value = section(Value)
    moving: Value = section(Value)
    reaction_time: Value = section(Value)
    stopping_time: Value = section(Value)
    active: Value = section(Value)
    very_active: Value = section(Value)
    weak_shoulder: Value = section(Value)


@dataclass(frozen=True)
class AreaTable(ValueTable):
    """Areas over which a contact can act [m^2]; config/tables/contact_areas.yaml."""

    smallest: Value = section(Value)
    largest: Mapping[str, float] = mapping(number(above=0.0), text="by region")
