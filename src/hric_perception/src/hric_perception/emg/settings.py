"""How the envelope of EMG is made, as parameters tell it. No ROS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hric_perception.section import Section

KEYS = ("band", "band_order", "notch", "notch_quality", "lowpass", "lowpass_order", "mvc", "decimate")


@dataclass(frozen=True)
class Settings:
    """The chain.

    Args:
        band: edges of the band-pass [Hz]; 20 to 450 Hz is what surface EMG is recorded with by custom (SENIAM, ISEK; textbook).
        band_order: of the Butterworth prototype; the band-pass has twice as many poles.
        notch: frequencies that are cut out [Hz]; 50 Hz: the mains.
        notch_quality: frequency over width at -3 dB.
        lowpass: of the rectified signal [Hz]; 3 to 6 Hz by custom (textbook).
        lowpass_order: Butterworth.
        mvc: envelope of the maximum voluntary contraction by channel [unit of the channel]; others are not normalised.
        decimate: every so many samples one of the envelope.
    """

    band: tuple[float, float] = (20.0, 450.0)
    band_order: int = 2
    notch: tuple[float, ...] = (50.0,)
    notch_quality: float = 30.0
    lowpass: float = 6.0
    lowpass_order: int = 4
    mvc: tuple[tuple[str, float], ...] = ()
    decimate: int = 10


def read_settings(section: Section) -> Settings:
    """Of a mapping. Raises HricError."""
    section.only(*KEYS)
    base = Settings()
    band = section.numbers(f"{section.where}.band", section.content.get("band", list(base.band)), (2,))
    notch: Any = section.content.get("notch", list(base.notch))
    mvc = section.section("mvc")
    return Settings(
        (band[0], band[1]),
        section.whole("band_order", base.band_order, 1, 8),
        tuple(Section.numbers(f"{section.where}.notch", notch, range(9))),
        section.number("notch_quality", base.notch_quality, 0.0, above=True),
        section.number("lowpass", base.lowpass, 0.0, above=True),
        section.whole("lowpass_order", base.lowpass_order, 1, 8),
        tuple((name, mvc.number(name, 1.0, 0.0, above=True)) for name in mvc.content),
        section.whole("decimate", base.decimate, 1, 10000),
    )
