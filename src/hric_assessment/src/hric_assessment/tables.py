"""The published tables, and the one loader of their files.

    limits = limit_table("iso_ts_15066")        # or "bgia2011", or a Path to a user's own file
    rula_table(), reba_table(), niosh_table(), separation_table(), episode_table(), verdict_table()

Each file in config/tables has the values in the units in which they are printed, their sources, and a mark for each: by
how many public sources it is confirmed. What is read here is as printed; who computes converts to SI.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from hric_control.node import REQUIRED
from hric_control.parameters import (
    Mistakes,
    Settings,
    choice,
    either,
    listing,
    mapping,
    names,
    number,
    numbers,
    package_yaml,
    read_yaml,
    refused,
    section,
    text,
    unknown,
    whole,
)
from hric_human.body.regions import REGION_MODELS

MARKS = ("confirmed twice", "confirmed once", "unconfirmed", "chosen here")
"""Of a value: seen in two or more independent public sources, in one, from memory only, or of no source."""
FOOT = "foot, toes, ankle"
"""A region of BG/BGIA that ISO/TS 15066 and so `hric_human.body.regions` do not have."""
REGIONS = (*REGION_MODELS, FOOT)
LIMIT_TABLES = ("iso_ts_15066", "bgia2011")
"""Those that come with the package; the first is the default."""
NO_TRANSIENT = "none"
"""In place of a transient limit: a touch is not permitted, however short and soft."""
T = TypeVar("T", bound="Table")
UNITS = {"force": 1.0, "pressure": 1e4, "stiffness": 1e3, "length": 1e-2}
"""What a printed unit is in SI: N, N/cm^2, N/mm, cm."""


def _short_names(of: str, default: str = "") -> Any:
    return listing(text(empty=False), default=(), different=True, single=True, text=of, default_text=default)


@dataclass(frozen=True)
class Table(Settings):
    """What each file begins with."""

    title: str = text(empty=False, text="as findings name it")
    edition: str = text(empty=False, figures=True, text="likewise")
    sources: Mapping[str, str] = mapping(text(empty=False), text="by short name")
    mark: str = choice(*MARKS, default="unconfirmed", text="of all values that have none of their own")
    source: tuple[str, ...] = _short_names("of all values that have none of their own, short names")

    def check(self, where: str) -> None:
        """Refuse sources that the file does not describe."""
        check_sources(self.source, self.sources, where.rstrip(" :."))

    @property
    def name(self) -> str:
        """For findings."""
        return self.title if self.edition in self.title else f"{self.title} ({self.edition})"

    def mark_of(self, row: "Marked") -> str:
        """One of MARKS."""
        return row.mark or self.mark

    def source_of(self, row: "Marked") -> tuple[str, ...]:
        """Short names of its sources."""
        return row.source or self.source


@dataclass(frozen=True)
class Marked(Settings):
    """A row with its mark and sources, where these are not the file's."""

    mark: str | None = choice(*MARKS, default=None, default_text="the file's", text="of the row")
    source: tuple[str, ...] = _short_names("of the row", "the file's")


def check_sources(given: Sequence[str], sources: Mapping[str, str], where: str) -> None:
    """Raises UnknownParameterError for a source that is not described."""
    for name in given:
        if name not in sources:
            raise unknown("source", name, sources, where)


@dataclass(frozen=True)
class Row(Marked):
    """A limit of a region, or of an area of it."""

    region: str = choice(*REGIONS, default=REQUIRED, text="of the body")
    area: str | None = text(None, empty=False, text="of the region, by any name; without one all of it")
    quasi_static: float = number(above=0.0, text="limit of what lasts")
    transient: float | str | None = either(
        number(above=0.0),
        choice(NO_TRANSIENT),
        default=None,
        default_text="by the factor",
        text="limit of what does not; `none`: there is none",
    )

    def transient_by(self, factor: float | None) -> float | None:
        """Transient limit in the unit of the row; None: there is none, a touch is not permitted."""
        if self.transient == NO_TRANSIENT:
            return None
        return float(self.transient) if self.transient is not None else self.quasi_static * (factor or 1.0)


@dataclass(frozen=True)
class ForceRow(Row):
    """Forces [N]."""

    stiffness: float | None = number(
        None, above=0.0, unit="N/mm", default_text="of `hric_human.body.regions`", text="of the region's spring"
    )

    def check(self, where: str) -> None:
        """Refuse a region without a spring."""
        if self.stiffness is None and self.region not in REGION_MODELS:
            raise refused(f"{where}stiffness", None, f"a number: the body model has none of {self.region}")


@dataclass(frozen=True)
class PressureRow(Row):
    """Pressures [N/cm^2]."""

    number: int | None = whole(None, minimum=1, text="in the source")
    hand: str | None = choice("dominant", "other", default=None, text="on which side; without one both")


@dataclass(frozen=True)
class LimitTable(Table):
    """What a person bears of a contact."""

    force_factor: float | None = number(
        None, minimum=1.0, unit="1", text="transient over quasi-static force of rows without a transient one"
    )
    pressure_factor: float | None = number(None, minimum=1.0, unit="1", text="likewise of pressures")
    forces: tuple[ForceRow, ...] = listing(section(ForceRow), text="rows [N], see below")
    pressures: tuple[PressureRow, ...] = listing(section(PressureRow), default=(), text="rows [N/cm^2], see below")

    def check(self, where: str) -> None:
        """Refuse rows twice, without a transient limit, and pressures of what has no force."""
        super().check(where)
        mistakes = Mistakes()
        kinds: Sequence[tuple[str, Sequence[Row], str, float | None]] = (
            ("forces", self.forces, "force_factor", self.force_factor),
            ("pressures", self.pressures, "pressure_factor", self.pressure_factor),
        )
        for key, rows, name, factor in kinds:
            labels = [(row.region, row.area, getattr(row, "hand", None)) for row in rows]
            for index, row in enumerate(rows):
                with mistakes.noted():
                    at = f"{where}{key}[{index}]"
                    self._check_row(row, labels, at)
                    if row.transient is None and factor is None:
                        raise refused(f"{at}.transient", None, f"a number, {NO_TRANSIENT}, or a {name} for all rows")
        mistakes.raise_all()

    def _check_row(self, row: Row, labels: Sequence[Any], where: str) -> None:
        check_sources(row.source, self.sources, where)
        label = (row.region, row.area, getattr(row, "hand", None))
        if labels.count(label) > 1:
            raise refused(where, ", ".join(filter(None, label)), "each region, area and hand once")
        if isinstance(row, PressureRow) and not self.force_rows(row.region, row.area):
            raise refused(f"{where}.region", row.region, "a region, and an area, that forces have too")

    def force_rows(self, region: str, area: str | None = None) -> list[ForceRow]:
        """Rows for an area of a region; of an area without a row of its own those without an area; without an area all
        of the region."""
        rows = [row for row in self.forces if row.region == region]
        if area is None:
            return rows
        return [row for row in rows if row.area == area] or [row for row in rows if row.area is None]

    def pressure_rows(self, region: str, area: str | None = None, hand: str | None = None) -> list[PressureRow]:
        """Rows for an area of a region; hand: "dominant" or "other", without one both."""
        return [
            row
            for row in self.pressures
            if row.region == region and area in (None, row.area) and (hand is None or row.hand in (None, hand))
        ]


@dataclass(frozen=True)
class Chosen(Settings):
    """A threshold that no source has [deg]."""

    value: float = number(unit="deg", minimum=0.0)
    text: str = text(empty=False)


@dataclass(frozen=True)
class Band(Settings):
    """Scores between the bounds of an angle [deg], from below.

    Attributes:
        bounds: numbers, or names of chosen thresholds, with a minus in front for their negatives.
        higher_on: bounds on which the higher score counts; on all others the lower.
        unless: a flag where the score is `then`.
    """

    angle: str = text(empty=False)
    bounds: tuple[float | str, ...] = listing(either(number(), text(empty=False)))
    scores: tuple[int, ...] = listing(whole())
    higher_on: tuple[float, ...] = numbers(default=())
    unless: str | None = text(None, empty=False)
    then: int = whole(0)

    def check(self, where: str) -> None:
        """Refuse bounds and scores that do not go together."""
        if len(self.scores) != len(self.bounds) + 1:
            raise refused(f"{where}scores", list(self.scores), f"{len(self.bounds) + 1} values, one more than bounds")


@dataclass(frozen=True)
class Condition(Settings):
    """A flag; or an angle above a threshold, or beyond it to either side; the threshold is one of the chosen."""

    flag: str | None = text(None, empty=False)
    angle: str | None = text(None, empty=False)
    above: str | None = text(None, empty=False)
    beyond: str | None = text(None, empty=False)

    def check(self, where: str) -> None:
        """Refuse all but one of the three forms."""
        given = [name for name in ("flag", "angle", "above", "beyond") if getattr(self, name) is not None]
        if given not in (["flag"], ["angle", "above"], ["angle", "beyond"]):
            raise refused(where.rstrip(". "), ", ".join(given), "flag, or angle with above, or angle with beyond")


@dataclass(frozen=True)
class Adder(Settings):
    """A score where any of some conditions holds."""

    score: int = whole()
    text: str = text(empty=False)
    any: tuple[Condition, ...] = listing(section(Condition))


@dataclass(frozen=True)
class Part(Settings):
    """A part of the body."""

    start: int = whole(0)
    bands: tuple[Band, ...] = listing(section(Band), default=())
    add: tuple[Adder, ...] = listing(section(Adder), default=())


@dataclass(frozen=True)
class PostureTable(Table):
    """What RULA and REBA have in common.

    Attributes:
        levels: name of each level by its highest score, as text.
        table_a, table_b, table_c: rows by their numbers, as text, with the columns in order.
    """

    chosen: Mapping[str, Chosen] = mapping(section(Chosen))
    parts: Mapping[str, Part] = mapping(section(Part))
    static_time: float = number(unit="s", above=0.0)
    repeats: float = number(unit="1/min", above=0.0)
    light: float = number(unit="kg", minimum=0.0)
    heavy: float = number(unit="kg", minimum=0.0)
    levels: Mapping[str, str] = mapping(text(empty=False))
    table_a: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1)))
    table_b: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1)))
    table_c: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1)))

    def check(self, where: str) -> None:
        """Refuse thresholds that are not among the chosen."""
        super().check(where)
        for name, part in self.parts.items():
            bounds = [bound.lstrip("-") for band in part.bands for bound in band.bounds if isinstance(bound, str)]
            conditions = [condition for adder in part.add for condition in adder.any if condition.angle]
            for threshold in [*bounds, *(one.above or one.beyond for one in conditions)]:
                if threshold not in self.chosen:
                    raise unknown("threshold", threshold, self.chosen, f"{where}parts.{name}")

    def level(self, score: int) -> str:
        """Name of the level of a score."""
        return next(name for highest, name in self.levels.items() if score <= int(highest))


@dataclass(frozen=True)
class RulaTable(PostureTable):
    """RULA; older_rows: those of table A in which an older worksheet differs, with the mark older_mark."""

    older_mark: str = choice(*MARKS, default="unconfirmed")
    older_rows: Mapping[str, tuple[int, ...]] = mapping(listing(whole(minimum=1), 8), default={})


@dataclass(frozen=True)
class RebaTable(PostureTable):
    """REBA; couplings: in order of their scores from 0 on."""

    couplings: tuple[str, ...] = names()


@dataclass(frozen=True)
class Value(Marked):
    """A value alone."""

    value: float = number()


@dataclass(frozen=True)
class ValueTable(Table):
    """A table of single values."""

    def check(self, where: str) -> None:
        """Refuse sources that the file does not describe."""
        super().check(where)
        for name, row in self.values.items():
            check_sources(row.source, self.sources, f"{where}{name}")

    @property
    def values(self) -> dict[str, Value]:
        """By name."""
        return {name: value for name, value in vars(self).items() if isinstance(value, Value)}

    def __getitem__(self, name: str) -> float:
        """As printed. Raises KeyError."""
        return self.values[name].value


@dataclass(frozen=True)
class NioshTable(ValueTable):
    """The lifting equation; what each is: config/tables/niosh.yaml."""

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
    """What a protective separation distance takes where nothing else is known; config/tables/separation.yaml."""

    walking_speed: Value = section(Value)
    hand_speed: Value = section(Value)
    near: Value = section(Value)
    intrusion_slope: Value = section(Value)
    intrusion_offset: Value = section(Value)
    resolution_limit: Value = section(Value)


@dataclass(frozen=True)
class EpisodeTable(ValueTable):
    """How contacts are cut; config/tables/episodes.yaml."""

    transient_time: Value = section(Value)
    rate: Value = section(Value)
    touch_force: Value = section(Value)
    gap: Value = section(Value)


@dataclass(frozen=True)
class VerdictTable(ValueTable):
    """Rules that no source has; config/tables/verdict.yaml."""

    near_limit: Value = section(Value)
    rula_within: Value = section(Value)
    rula_warning: Value = section(Value)
    reba_within: Value = section(Value)
    reba_warning: Value = section(Value)
    lasting: Value = section(Value)
    angle: Value = section(Value)
    known: Value = section(Value)
    lift: Value = section(Value)
    moving: Value = section(Value)
    reaction_time: Value = section(Value)
    stopping_time: Value = section(Value)
    active: Value = section(Value)
    very_active: Value = section(Value)
    weak_shoulder: Value = section(Value)


def limit_table(which: str | Path = LIMIT_TABLES[0]) -> LimitTable:
    """One of LIMIT_TABLES, or a user's own file, which takes its place.

    Raises:
        ParameterError: no such table, or a file that cannot be used, with all its mistakes.
    """
    if isinstance(which, Path):
        return LimitTable.of(read_yaml(which), f"{which.name}:")
    if which not in LIMIT_TABLES:
        raise unknown("limits", which, [*LIMIT_TABLES, "a YAML file"], "hric_assessment")
    return _built_in(LimitTable, which)


@cache
def rula_table() -> RulaTable:
    """config/tables/rula.yaml."""
    return _built_in(RulaTable, "rula")


@cache
def reba_table() -> RebaTable:
    """config/tables/reba.yaml."""
    return _built_in(RebaTable, "reba")


@cache
def niosh_table() -> NioshTable:
    """config/tables/niosh.yaml."""
    return _built_in(NioshTable, "niosh")


@cache
def separation_table() -> SeparationTable:
    """config/tables/separation.yaml."""
    return _built_in(SeparationTable, "separation")


@cache
def episode_table() -> EpisodeTable:
    """config/tables/episodes.yaml."""
    return _built_in(EpisodeTable, "episodes")


@cache
def verdict_table() -> VerdictTable:
    """config/tables/verdict.yaml."""
    return _built_in(VerdictTable, "verdict")


def _built_in(kind: type[T], name: str) -> T:
    return kind.of(package_yaml(__file__, f"tables/{name}"), f"{name}.yaml:")
