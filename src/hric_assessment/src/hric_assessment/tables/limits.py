"""Limits of contacts, as in their files."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hric_assessment.tables.base import MarkedRow, TableFile, check_sources
from hric_core.node import REQUIRED
from hric_core.parameters import Mistakes, choice, either, listing, number, refused, section, text, whole
from hric_human.body.regions import REGION_MODELS

FOOT = "foot, toes, ankle"
"""Region of BG/BGIA that ISO/TS 15066, and therefore `hric_human.body.regions`, do not have."""
REGIONS = (*REGION_MODELS, FOOT)
LARGEST_LIMIT, LARGEST_FACTOR = 1000.0, 10.0
"""Largest value of a row [N] or [N/cm^2], twice that of any published table (transient, 440 N and 600 N/cm^2); and
of a factor [1], five times the 2 of ISO/TS 15066."""
NO_TRANSIENT = "none"
"""Value of a missing transient limit: a touch is not permitted, however short and soft."""


@dataclass(frozen=True)
class LimitRow(MarkedRow):
    """Limit of a region, or of an area of it."""

    region: str = choice(*REGIONS, default=REQUIRED, text="of the body")
    area: str | None = text(None, empty=False, text="of the region, by any name; without one all of it")
    quasi_static: float = number(above=0.0, maximum=LARGEST_LIMIT, text="limit of what lasts")
    transient: float | str | None = either(
        number(above=0.0, maximum=LARGEST_LIMIT),
        choice(NO_TRANSIENT),
        default=None,
        default_text="by the factor",
        text="limit of what does not; `none`: there is none",
    )

    def transient_by(self, factor: float | None) -> float | None:
        """Return the transient limit in the unit of the row; None: there is none, a touch is not permitted."""
        if self.transient == NO_TRANSIENT:
            return None
        return float(self.transient) if self.transient is not None else self.quasi_static * (factor or 1.0)


@dataclass(frozen=True)
class ForceRow(LimitRow):
    """Force limits [N]."""

    stiffness: float | None = number(
        None, above=0.0, unit="N/mm", default_text="of `hric_human.body.regions`", text="of the region's spring"
    )

    def check(self, where: str) -> None:
        """Refuse a region without a spring."""
        if self.stiffness is None and self.region not in REGION_MODELS:
            raise refused(f"{where}stiffness", None, f"a number: the body model has none of {self.region}")


@dataclass(frozen=True)
class PressureRow(LimitRow):
    """Pressure limits [N/cm^2]."""

    number: int | None = whole(None, minimum=1, text="in the source")
    hand: str | None = choice("dominant", "other", default=None, text="on which side; without one both")


@dataclass(frozen=True)
class LimitTable(TableFile):
    """Biomechanical limits of contacts."""

    force_factor: float | None = number(
        None,
        minimum=1.0,
        maximum=LARGEST_FACTOR,
        unit="1",
        text="transient over quasi-static force of rows without a transient one",
    )
    pressure_factor: float | None = number(
        None,
        minimum=1.0,
        maximum=LARGEST_FACTOR,
        unit="1",
        text="transient over quasi-static pressure of rows without a transient one",
    )
    forces: tuple[ForceRow, ...] = listing(section(ForceRow), text="rows [N], see below")
    pressures: tuple[PressureRow, ...] = listing(section(PressureRow), default=(), text="rows [N/cm^2], see below")

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
        mistakes.raise_all()

    def _check_row(self, row: LimitRow, labels: Sequence[Any], where: str) -> None:
        check_sources(row.source, self.sources, where)
        if isinstance(row.transient, float) and row.transient < row.quasi_static:
            raise refused(f"{where}.transient", row.transient, f"quasi_static, {row.quasi_static:g}, or more")
        label = (row.region, row.area, getattr(row, "hand", None))
        if labels.count(label) > 1:
            raise refused(where, ", ".join(filter(None, label)), "each region, area and hand once")
        if isinstance(row, PressureRow) and not self.force_rows(row.region, row.area):
            raise refused(f"{where}.region", row.region, "a region, and an area, that forces have too")

    def force_rows(self, region: str, area: str | None = None) -> list[ForceRow]:
        """Return the rows for an area of a region; without an area all rows of the region.

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
