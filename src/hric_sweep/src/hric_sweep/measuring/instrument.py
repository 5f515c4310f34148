"""Signal chain of a virtual measuring device: readings, filter, film; and the comparison with the limits.

ISO/PAS 5672:2023 describes such a device; its text was not opened, so the filter and the film's resolution have no
default: without a cut-off the force is not filtered, which gives the higher peak, and without the area of the contact
the pressure is not known.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from hric_assessment.contact.energy import MEASURED
from hric_assessment.contact.limits import TRANSIENT_TIME, ContactLimit, EnergyLimit, Limits
from hric_assessment.tables import UNITS
from hric_core.geometry import FloatArray

QUIET = 0.1
"""Time without force that the filter sees before and after the readings [s]."""


@dataclass(frozen=True)
class Instrument:
    """Filter and film of the device.

    Attributes:
        cutoff: cut-off frequency of the filter [Hz]: Butterworth, fourth order, without phase shift, as for crash tests
            (SAE J211); None: not filtered.
        film: edge of a cell of the pressure-sensitive film [m]; None: not known.
        area: area of the contact, the smaller of the robot's and the body's [m^2]; None: not known.
    """

    cutoff: float | None = None
    film: float | None = None
    area: float | None = None

    def filtered(self, readings: Sequence[float], step: float) -> FloatArray:
        """Return the filtered readings, shape (n,) [N]; step: time between two readings [s]."""
        force = np.array(readings)
        if self.cutoff is None:
            return force
        quiet = np.zeros(round(QUIET / step))
        sections = butter(2, self.cutoff, fs=1.0 / step, output="sos")
        return np.asarray(sosfiltfilt(sections, np.concatenate([quiet, force, quiet]))[len(quiet) : -len(quiet)])

    def pressure(self, force: float) -> float | None:
        """Return the mean pressure [Pa] that the film reads: the force over the cells that lie wholly in the contact.

        None: the area or the resolution is not known, or the contact is smaller than a cell.
        """
        cells = 0 if self.area is None or self.film is None else math.floor(self.area / self.film**2 + 1e-9)
        return force / (cells * self.film**2) if cells and self.film is not None else None


@dataclass(frozen=True)
class Quantity:
    """Row of the sheet: a measured value with its limit.

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
    force: FloatArray, step: float, energy: float, instrument: Instrument, limits: Limits, region: str
) -> list[Quantity]:
    """Return the rows of the sheet for one contact.

    Args:
        force: force of the device, filtered if it has a filter, shape (n,) [N].
        step: time between two readings [s].
        energy: largest work on the device's spring [J].
        instrument: filter and film.
        limits: limits of the body regions.
        region: body region that the device represents, one with a force limit.
    """
    limit, late = limits.at((region,)), round(TRANSIENT_TIME / step)
    assert limit is not None, "the caller has checked the region"
    peaks = {"transient": float(force[:late].max(initial=0.0)), "quasi-static": float(force[late:].max(initial=0.0))}
    ended = "" if len(force) > late else "the contact ended before"
    rows = [_of(kind, peaks[kind], limit, instrument, ended) for kind in peaks]
    allowed = limits.energy(region, held=False)
    return [row for pair in rows for row in pair] + [_energy(energy, allowed)]


def _of(kind: str, peak: float, limit: ContactLimit, instrument: Instrument, ended: str) -> list[Quantity]:
    transient, rows = kind == "transient", list[Quantity]()
    note = "" if transient else ended
    force = limit.force.transient if transient else limit.force.quasi_static
    rows.append(Quantity(f"{kind} force [N]", peak, force, note or limit.force.mark))
    if limit.pressure is not None:
        pressure, unit = limit.pressure.transient if transient else limit.pressure.quasi_static, UNITS["pressure"]
        read = instrument.pressure(peak)
        missing = "area or film not known, or smaller than a cell" if read is None else limit.pressure.mark
        value, top = None if read is None else read / unit, None if pressure is None else pressure / unit
        rows.append(Quantity(f"{kind} mean pressure [N/cm^2]", value, top, note or missing))
    return rows


def _energy(energy: float, allowed: EnergyLimit | None) -> Quantity:
    limit = None if allowed is None else allowed.energy
    return Quantity("energy [J]", energy, limit, MEASURED if allowed is None else allowed.mark)
