"""Signal chain of a virtual measuring device: readings, filter, film.

ISO/PAS 5672:2023 describes such a device; its text was not opened, so the filter and the film's resolution have no
default: without a cut-off the force is not filtered, which gives the higher peak, and without the area of the contact
the pressure is not known.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

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

    def facts(self) -> Mapping[str, str]:
        """Return a description of filter and film by name, for the sheet."""
        return {
            "filter": "none" if self.cutoff is None else f"low pass {self.cutoff:g} Hz, fourth order, no phase shift",
            "film": "not known" if self.film is None else f"cells of {1e3 * self.film:g} mm",
            "area of the contact": "not known" if self.area is None else f"{1e4 * self.area:g} cm^2",
        }
