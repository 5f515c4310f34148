"""Writer of EMG as a BDF file (24 bit, BioSemi's form of the European data format), which EMG in BIDS needs."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hric_bags.export.table import ExportError, FloatArray
from hric_bags.export.trial.c3d_trial import Channel
from hric_core.trial.c3d import VOLTS

UNIT = "uV"
"""Unit of the samples in the file."""
LARGEST = 2**23 - 1
"""Largest number of 24 bits; the smallest one is its negative, so that 0 V is 0."""
DATE = "01.01.85"
"""Date of the recording: the one that EDF+ prescribes for files without a date."""


def write_bdf(path: Path, channels: Sequence[Channel], rate: float) -> None:
    """Write EMG channels in records of about one second; the last record is filled up with the last sample.

    A channel is stored with a resolution of 2**-23 of its peak, rounded up to whole microvolts.

    Args:
        path: file to write.
        channels: channels in units of a voltage, with values of the same number of samples.
        rate: sample rate [Hz].

    Raises:
        ExportError: a value is not known, or too large for the format.
    """
    values, size, count = _microvolts(channels), max(1, round(rate)), len(channels)
    values = np.pad(values, ((0, 0), (0, -values.shape[1] % size)), mode="edge")
    peaks = [max(1, math.ceil(peak)) for peak in np.abs(values).max(axis=1)]
    if max(peaks) > 9_999_999:  # a number has eight characters, with its sign
        raise ExportError(f"EMG of {max(peaks)} uV does not fit into a BDF file; valid: below 10 V")
    head: list[tuple[Sequence[object], int]] = [
        (["X X X X"], 80),
        (["Startdate X X X hric_bags"], 80),
        ([DATE], 8),
        (["00.00.00"], 8),
        ([256 * (count + 1)], 8),
        (["24BIT"], 44),
        ([values.shape[1] // size], 8),
        ([f"{size / rate:.6f}"], 8),
        ([count], 4),
        ([channel.label[:16] for channel in channels], 16),
        ([""] * count, 80),
        ([UNIT] * count, 8),
        ([-peak for peak in peaks], 8),
        (peaks, 8),
        ([-LARGEST] * count, 8),
        ([LARGEST] * count, 8),
        ([""] * count, 80),
        ([size] * count, 8),
        ([""] * count, 32),
    ]
    text = "".join(f"{entry!s:<{width}.{width}}" for entries, width in head for entry in entries)
    digital = np.rint(values / np.array(peaks)[:, None] * LARGEST).astype("<i4")
    records = digital.reshape(count, -1, size).transpose(1, 0, 2)
    low_bytes = np.ascontiguousarray(records).view(np.uint8).reshape(-1, 4)[:, :3]
    path.write_bytes(b"\xffBIOSEMI" + text.encode("ascii", "replace") + low_bytes.tobytes())


def _microvolts(channels: Sequence[Channel]) -> FloatArray:
    """Return the values of the channels, shape (channels, samples) [uV]. Raises ExportError if one is NaN."""
    if unknown := [channel.label for channel in channels if not np.isfinite(channel.values).all()]:
        raise ExportError(f"EMG of {', '.join(unknown)} has samples that are not known (NaN); leave it out by --topics")
    return np.stack([channel.values * (VOLTS[channel.unit.lower()] * 1e6) for channel in channels])
