"""Contact limit tables (ISO/TS 15066, BG/BGIA, or a user's), as they stand in their files."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from hric_assessment.tables.base import UNCONFIRMED, MarkedRow, TableFile, check_sources
from hric_core.node import REQUIRED
from hric_core.parameters import Mistakes, choice, either, listing, number, refused, section, text, whole
from hric_human.body.regions import REGION_MODELS

FOOT = "foot, toes, ankle"
"""Body region of BG/BGIA that ISO/TS 15066, and therefore `hric_human.body.regions`, do not have."""
REGIONS = (*REGION_MODELS, FOOT)
LARGEST_LIMIT, LARGEST_FACTOR = 1000.0, 10.0
"""Largest accepted limit [N] or [N/cm^2], and largest accepted factor from quasi-static to transient limits [1].

Published tables have up to 440 N and 600 N/cm^2 (transient), ISO/TS 15066 a factor of 2.
"""
NO_TRANSIENT = "none"
"""Text in place of a transient limit: contact is not permitted, however short and soft."""


@dataclass(frozen=True)
class LimitRow(MarkedRow):
    """Row of a limit table: limits of a body region, or of an area in it."""

    region: str = choice(*REGIONS, default=REQUIRED, text="body region")
    area: str | None = text(None, empty=False, text="area in the region, by any name; none: the whole region")
    quasi_static: float = number(above=0.0, maximum=LARGEST_LIMIT, text="limit of quasi-static contact")
    transient: float | str | None = either(
        number(above=0.0, maximum=LARGEST_LIMIT),
        choice(NO_TRANSIENT),
        default=None,
        default_text="by the factor",
        text="limit of transient contact; `none`: contact is not permitted",
    )

    def transient_by(self, factor: float | None) -> float | None:
        """Return the transient limit in the unit of the row; None: contact is not permitted.

        factor: ratio of transient to quasi-static limit, for a row without a transient limit of its own.
        """
        if self.transient == NO_TRANSIENT:
            return None
        return float(self.transient) if self.transient is not None else self.quasi_static * (factor or 1.0)

    def scaled(self, factor: float) -> Self:
        """Return the row with its limits multiplied by a factor [1], up to the largest accepted limit."""
        held, short = min(factor * self.quasi_static, LARGEST_LIMIT), self.transient
        short = min(factor * short, LARGEST_LIMIT) if isinstance(short, float) else short
        return replace(self, quasi_static=held, transient=short)


@dataclass(frozen=True)
class ForceRow(LimitRow):
    """Row with force limits [N]."""

    stiffness: float | None = number(
        None, above=0.0, unit="N/mm", default_text="of `hric_human.body.regions`", text="stiffness of the region"
    )

    def check(self, where: str) -> None:
        """Refuse a region without a stiffness."""
        if self.stiffness is None and self.region not in REGION_MODELS:
            raise refused(f"{where}stiffness", None, f"a number, since the body model has none for {self.region}")


@dataclass(frozen=True)
class PressureRow(LimitRow):
    """Row with pressure limits [N/cm^2]."""

    number: int | None = whole(None, minimum=1, text="number of the body area in the source")
    hand: str | None = choice("dominant", "other", default=None, text="side for which the row holds; none: both")


@dataclass(frozen=True)
class EnergyRow(MarkedRow):
    """Row with the largest energy of a transient contact [J]."""

    region: str = choice(*REGIONS, default=REQUIRED, text="body region")
    transient: float = number(above=0.0, maximum=LARGEST_LIMIT, text="largest energy of a transient contact")

    def scaled(self, factor: float) -> Self:
        """Return the row with its energy multiplied by a factor [1], up to the largest accepted limit."""
        return replace(self, transient=min(factor * self.transient, LARGEST_LIMIT))


@dataclass(frozen=True)
class LimitTable(TableFile):
    """Table of biomechanical limits of contacts: forces and pressures by body region."""

    force_factor: float | None = number(
        None,
        minimum=1.0,
        maximum=LARGEST_FACTOR,
        unit="1",
        text="ratio of transient to quasi-static force, for rows without a transient limit",
    )
    pressure_factor: float | None = number(
        None,
        minimum=1.0,
        maximum=LARGEST_FACTOR,
        unit="1",
        text="ratio of transient to quasi-static pressure, for rows without a transient limit",
    )
    forces: tuple[ForceRow, ...] = listing(section(ForceRow), text="rows [N], see below")
    pressures: tuple[PressureRow, ...] = listing(section(PressureRow), default=(), text="rows [N/cm^2], see below")
    energies: tuple[EnergyRow, ...] = listing(
        section(EnergyRow), default=(), text="rows [J]; a region without one has the energy of its force limit"
    )

    def check(self, where: str) -> None:
        """Refuse duplicate rows, rows without a transient limit, and pressures of areas without a force."""
        super().check(where)
        mistakes = Mistakes()
        kinds: Sequence[tuple[str, Sequence[LimitRow], str, float | None]] = (
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
        regions = [energy.region for energy in self.energies]
        for index, energy in enumerate(self.energies):
            with mistakes.noted():
                check_sources(energy.source, self.sources, f"{where}energies[{index}]")
                if regions.count(energy.region) > 1:
                    raise refused(f"{where}energies[{index}]", energy.region, "each region once")
        mistakes.raise_all()

    def _check_row(self, row: LimitRow, labels: Sequence[Any], where: str) -> None:
        check_sources(row.source, self.sources, where)
        if isinstance(row.transient, float) and row.transient < row.quasi_static:
            raise refused(f"{where}.transient", row.transient, f"quasi_static, {row.quasi_static:g}, or more")
        label = (row.region, row.area, getattr(row, "hand", None))
        if labels.count(label) > 1:
            raise refused(where, ", ".join(filter(None, label)), "each region, area and hand once")
        if isinstance(row, PressureRow) and not self.force_rows(row.region, row.area):
            raise refused(f"{where}.region", row.region, "a region and area that also have a row in forces")

    def scaled(self, factor: float) -> "LimitTable":
        """Return a copy in which the limits of rows with the mark "unconfirmed" are multiplied by a factor [1]."""
        if factor == 1.0:
            return self
        forces = tuple(row.scaled(factor) if self.mark_of(row) == UNCONFIRMED else row for row in self.forces)
        pressures = tuple(row.scaled(factor) if self.mark_of(row) == UNCONFIRMED else row for row in self.pressures)
        energies = tuple(row.scaled(factor) if self.mark_of(row) == UNCONFIRMED else row for row in self.energies)
        return replace(self, forces=forces, pressures=pressures, energies=energies)

    def force_rows(self, region: str, area: str | None = None) -> list[ForceRow]:
        """Return the force rows for an area of a region; without an area, all force rows of the region.

        If the area has no row, the rows of the region without an area are returned.
        """
        rows = [row for row in self.forces if row.region == region]
        if area is None:
            return rows
        return [row for row in rows if row.area == area] or [row for row in rows if row.area is None]

    def pressure_rows(self, region: str, area: str | None = None, hand: str | None = None) -> list[PressureRow]:
        """Return the pressure rows for an area of a region; hand: "dominant" or "other"; None: both."""
        return [
            row
            for row in self.pressures
            if row.region == region and area in (None, row.area) and (hand is None or row.hand in (None, hand))
        ]
