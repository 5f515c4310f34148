"""Comparison of one contact that a measuring device has measured with the limits of the body region it represents."""

from collections.abc import Callable
from dataclasses import dataclass

from hric_assessment.contact.energy import MEASURED
from hric_assessment.contact.limits import TRANSIENT_TIME, ContactLimit, EnergyLimit, Limits
from hric_assessment.tables import UNITS
from hric_core.geometry import FloatArray

Pressure = Callable[[float], float | None]


@dataclass(frozen=True)
class MeasuredQuantity:
    """Value that a measuring device measured, with its limit.

    Attributes:
        name: name of the quantity, with its unit.
        value: measured value; None: not known.
        limit: limit; None: not known, or contact is not permitted.
        note: mark of the limit, or the reason why a value is missing.
    """

    name: str
    value: float | None
    limit: float | None
    note: str

    @property
    def result(self) -> str:
        """Comparison of value and limit in words; "not known" if one of them is missing."""
        if self.value is None or self.limit is None:
            return "not known"
        return f"{100.0 * self.value / self.limit:.0f} % of the limit"


def quantities(
    force: FloatArray, step: float, energy: float, pressure: Pressure, limits: Limits, region: str
) -> list[MeasuredQuantity]:
    """Return the quantities that a measuring device measured in one contact, with their limits.

    Args:
        force: force of the device, filtered if it has a filter, shape (n,) [N].
        step: time between two readings [s].
        energy: largest work on the device's spring [J].
        pressure: function that returns the mean pressure of the film [Pa] at a force [N]; None: not known.
        limits: limits of the body regions.
        region: body region that the device represents, one with a force limit.
    """
    limit, late = limits.at((region,)), round(TRANSIENT_TIME / step)
    assert limit is not None, "the caller has checked the region"
    peaks = {"transient": float(force[:late].max(initial=0.0)), "quasi-static": float(force[late:].max(initial=0.0))}
    ended = "" if len(force) > late else "the contact ended before"
    rows = [_of(kind, peaks[kind], limit, pressure, ended) for kind in peaks]
    allowed = limits.energy(region, held=False)
    return [row for pair in rows for row in pair] + [_energy(energy, allowed)]


def _of(kind: str, peak: float, limit: ContactLimit, reading: Pressure, ended: str) -> list[MeasuredQuantity]:
    transient, rows = kind == "transient", list[MeasuredQuantity]()
    note = "" if transient else ended
    force = limit.force.transient if transient else limit.force.quasi_static
    rows.append(MeasuredQuantity(f"{kind} force [N]", peak, force, note or limit.force.mark))
    if limit.pressure is not None:
        pressure, unit = limit.pressure.transient if transient else limit.pressure.quasi_static, UNITS["pressure"]
        read = reading(peak)
        missing = "area or film not known, or area smaller than a cell" if read is None else limit.pressure.mark
        value, top = None if read is None else read / unit, None if pressure is None else pressure / unit
        rows.append(MeasuredQuantity(f"{kind} mean pressure [N/cm^2]", value, top, note or missing))
    return rows


def _energy(energy: float, allowed: EnergyLimit | None) -> MeasuredQuantity:
    limit = None if allowed is None else allowed.energy
    return MeasuredQuantity("energy [J]", energy, limit, MEASURED if allowed is None else allowed.mark)
