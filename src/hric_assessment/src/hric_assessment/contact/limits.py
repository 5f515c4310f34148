"""Force and pressure limits of a person's body regions, in SI units; only this module reads the limit tables.

    limits = Limits.named()                                               # or "bgia2011", or the path of a YAML file
    limits.at(("hand, fingers",), dominant=True).force.transient          # [N]

If several regions or areas may be in contact and it is unknown which, the lowest of their limits applies.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from hric_assessment.tables import (
    LIMIT_TABLES,
    LIMITS,
    MASS,
    REGIONS,
    STIFFNESS,
    UNITS,
    LimitRow,
    LimitTable,
    PressureRow,
    episode_table,
    limit_table,
)
from hric_core.errors import check_known
from hric_human.body.regions import REGION_MODELS

NOT_PERMITTED = ("skull, forehead", "face")
"""Regions with which no contact is within limits, even if a table has values for them.

ISO/TS 15066:2016, Annex A (confirmed twice). The quasi-static values of a table are for information.
"""
TRANSIENT_TIME = episode_table()["transient_time"]
"""Time since the first touch after which a contact is quasi-static [s] (config/tables/episodes.yaml)."""
PARTED = episode_table()["gap"]
"""Time without a touch after which a contact episode has ended [s] (config/tables/episodes.yaml)."""


@dataclass(frozen=True)
class LimitPair:
    """Quasi-static and transient limit of one quantity, both in N or Pa.

    Attributes:
        quasi_static: quasi-static limit.
        transient: transient limit; None: the table has none, since contact is not permitted.
        region, area: region and area of the quasi-static limit; area "": the whole region.
        mark: mark of the table row (how well its value is confirmed), and its sources.
    """

    quasi_static: float
    transient: float | None
    region: str
    area: str
    mark: str

    @property
    def label(self) -> str:
        """Region and area of the limit, for findings."""
        return f"{self.region}: {self.area}" if self.area else self.region


@dataclass(frozen=True)
class ContactLimit:
    """Limits that apply to a contact with one of several body regions.

    Attributes:
        force: force limits [N].
        pressure: pressure limits [Pa]; None: the table has none.
        permitted: False if the contact may be with a region of NOT_PERMITTED.
        stiffness: stiffness of the stiffest region that may be in contact [N/m].
        missing: quantities that the table lacks for the regions that may be in contact.
    """

    force: LimitPair
    pressure: LimitPair | None
    permitted: bool
    stiffness: float
    missing: tuple[str, ...]

    def held(self) -> "ContactLimit":
        """Return the limits of a contact that is quasi-static from its begin."""
        force, pressure = replace(self.force, transient=None), self.pressure
        return replace(self, force=force, pressure=None if pressure is None else replace(pressure, transient=None))


@dataclass(frozen=True)
class EnergyLimit:
    """Largest energy of a contact with one region.

    Attributes:
        region: the region.
        energy: largest energy [J].
        stiffness: stiffness of the region [N/m].
        mark: how well the value is confirmed, with its sources, or how it was computed.
    """

    region: str
    energy: float
    stiffness: float
    mark: str


class Limits:
    """Contact limits by body region, from one table.

    Args:
        table: table of limits.
        factors: factors of unconfirmed numbers, by their names in config/tables/uncertain.yaml; a missing one is 1.
    """

    def __init__(self, table: LimitTable, factors: Mapping[str, float] = MappingProxyType({})) -> None:
        self.table, self._factors = table.scaled(factors.get(LIMITS, 1.0)), factors

    def varied(self, factors: Mapping[str, float]) -> "Limits":
        """Return the limits with unconfirmed numbers multiplied by factors; factors: see the class."""
        return Limits(self.table, factors)

    def mass(self, region: str) -> float:
        """Return the effective mass of a region in the body model [kg]."""
        return REGION_MODELS[region].mass * self._factors.get(MASS, 1.0)

    @classmethod
    def named(cls, which: str | Path = LIMIT_TABLES[0]) -> "Limits":
        """Return the limits of a table of the package, by its name, or of a user's file, by its path.

        Raises:
            ParameterError: there is no such table, or the file is invalid; all its mistakes are listed.
        """
        return cls(limit_table(which))

    def held_force(self, regions: Sequence[str]) -> float:
        """Return the lowest quasi-static force limit of some regions [N].

        Return 0 if the table has no limit for them, or contact with one of them is not permitted.

        Raises:
            HricError: a region does not exist.
        """
        limit = self.at(regions)
        return 0.0 if limit is None or not limit.permitted else limit.force.quasi_static

    def at(self, regions: Sequence[str], area: str | None = None, dominant: bool | None = None) -> ContactLimit | None:
        """Return the limits for a contact with one of some regions.

        Args:
            regions: regions of `hric_human.body.regions`, or the foot; it is unknown which of several is in contact.
            area: specific area of the table, which leaves only the regions that have it; None: not known.
            dominant: True on the side of the dominant hand; None: not known.

        Returns:
            the limits; None: the table has none for any of the regions.

        Raises:
            HricError: a region does not exist, or none of the regions has the area.
        """
        check_known("region", regions, REGIONS, "ISO/TS 15066 or BG/BGIA")
        if area is not None:
            check_known("area", [area], self.areas(regions), self.table.title)
            regions = [region for region in regions if area in self.areas([region])]
        hand = None if dominant is None else "dominant" if dominant else "other"
        forces = [row for region in regions for row in self.table.force_rows(region, area)]
        pressures: Sequence[LimitRow] = [
            row for region in regions for row in self.table.pressure_rows(region, area, hand)
        ]
        if not forces:
            return None
        springs = [
            row.stiffness * UNITS["stiffness"] if row.stiffness else REGION_MODELS[row.region].stiffness
            for row in forces
        ]
        return ContactLimit(
            self._lowest(forces, UNITS["force"], self.table.force_factor),
            self._lowest(pressures, UNITS["pressure"], self.table.pressure_factor) if pressures else None,
            not any(region in NOT_PERMITTED for region in regions),
            max(springs) * self._factors.get(STIFFNESS, 1.0),
            tuple(
                f"{name} of {region}"
                for name, rows in (("force", forces), ("pressure", pressures))
                for region in regions
                if not any(row.region == region for row in rows)
            ),
        )

    def energy(self, region: str, *, held: bool) -> EnergyLimit | None:
        """Return the largest energy of a contact with one region; None: the table has no limit for it.

        Without a row of the table, and for a held contact, it is F^2/(2 k) with the limit F of the force.

        Args:
            region: region of `hric_human.body.regions`, or the foot.
            held: True for a contact that is quasi-static from its begin.
        """
        limit = self.at((region,))
        force = None if limit is None else limit.force.quasi_static if held else limit.force.transient
        if limit is None or force is None:
            return None
        computed, kind = force * force / (2.0 * limit.stiffness), "quasi-static" if held else "transient"
        for row in () if held else self.table.energies:
            if row.region == region:
                sources = ", ".join(self.table.source_of(row)) or "no source given"
                mark = f"{self.table.mark_of(row)} ({sources}); F^2/(2 k) of the {kind} force limit: {computed:.3f} J"
                return EnergyLimit(region, row.transient, limit.stiffness, mark)
        mark = f"F^2/(2 k) of the {kind} force limit (computed; the table has no such energy)"
        return EnergyLimit(region, computed, limit.stiffness, mark)

    def areas(self, regions: Iterable[str]) -> list[str]:
        """Return the names of the specific areas that the table has in some regions."""
        rows: list[LimitRow] = [*self.table.forces, *self.table.pressures]
        return list(dict.fromkeys(row.area for row in rows if row.region in regions and row.area))

    def _lowest(self, rows: Sequence[LimitRow], unit: float, factor: float | None) -> LimitPair:
        lowest = min(rows, key=lambda row: row.quasi_static)
        transients = [row.transient_by(factor) for row in rows]
        transient = min(math.inf if value is None else value for value in transients) * unit
        hand = f", {lowest.hand} hand" if isinstance(lowest, PressureRow) and lowest.hand else ""
        return LimitPair(
            lowest.quasi_static * unit,
            None if None in transients else transient,
            lowest.region,
            f"{lowest.area or ''}{hand}",
            f"{self.table.mark_of(lowest)} ({', '.join(self.table.source_of(lowest)) or 'no source given'})",
        )
