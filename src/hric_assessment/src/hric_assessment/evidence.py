"""Evidence: how much of the time of a finding is covered by finite samples, and how densely.

    evidence = Evidence.of(time, finite, (begin, end), max_gap)
    evidence.complete, evidence.shortfall

A stretch between two finite samples is known if it is not longer than the longest gap that may be bridged. Time counts,
not samples: a thousand samples in the first second say nothing about the second one.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hric_core.geometry import FloatArray

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
JITTER = 1e-3
"""Tolerance of stamps when a gap is compared with the longest one that may be bridged [s] (project default)."""


def finite_rows(values: FloatArray) -> BoolArray:
    """Return a mask of the rows whose values are all finite, shape (n,); values: shape (n, k)."""
    return np.asarray(np.isfinite(values).all(axis=1))


@dataclass(frozen=True)
class Evidence:
    """Known part of a window.

    Attributes:
        requested: length of the window [s].
        known: known part of it [s].
        rate: finite samples per known second [Hz].
        longest_gap: longest time without a finite sample, ends of the window included [s].
        not_finite: number of samples in the window that are NaN or infinite.
        max_gap: longest gap that may be bridged [s].
        arm_motion: share of the arm's time in motion that is known [1]; None: the finding does not need it.
    """

    requested: float
    known: float
    rate: float
    longest_gap: float
    not_finite: int
    max_gap: float
    arm_motion: float | None = None

    @classmethod
    def of(cls, time: FloatArray, finite: BoolArray, window: tuple[float, float], max_gap: float) -> "Evidence":
        """Return the evidence of one signal.

        Args:
            time: ascending, shape (n,) [s].
            finite: True for each finite sample, shape (n,).
            window: begin and end [s].
            max_gap: longest gap that may be bridged [s].
        """
        begin, end = window
        gaps = unknown(time, finite, window, max_gap)
        inside = (time >= begin) & (time <= end)
        requested = max(end - begin, 0.0)
        known = requested - sum(b - a for a, b in gaps)
        samples = int((inside & finite).sum())
        edges = np.concatenate([[begin], time[inside & finite], [end]])
        longest = float(np.diff(edges).max()) if samples or requested > 0.0 else 0.0
        rate = samples / known if known > 0.0 else 0.0
        return cls(requested, known, rate, longest, int((inside & ~finite).sum()), max_gap)

    @property
    def complete(self) -> bool:
        """True if no gap is longer than may be bridged and the arm's motion is completely known."""
        return self.longest_gap <= self.max_gap + JITTER and (self.arm_motion is None or self.arm_motion >= 1.0)

    @property
    def shortfall(self) -> str:
        """Missing part as one clause; empty if nothing is missing."""
        if self.complete:
            return ""
        clauses = []
        if self.longest_gap > self.max_gap + JITTER:
            clauses.append(
                f"known for {self.known:.2f} of {self.requested:.2f} s, longest gap {self.longest_gap:.2f} s"
            )
        if self.not_finite:
            clauses.append(f"{self.not_finite} samples not finite")
        if self.arm_motion is not None and self.arm_motion < 1.0:
            clauses.append(f"known for {100.0 * self.arm_motion:.0f} % of the time in which the arm moves")
        return ", ".join(clauses)

    def with_arm_motion(self, share: float) -> "Evidence":
        """Return a copy with the known share of the arm's motion [1]."""
        return replace(self, arm_motion=share)


def unknown(
    time: FloatArray, finite: BoolArray, window: tuple[float, float], max_gap: float
) -> list[tuple[float, float]]:
    """Return the unknown stretches of a window, [(begin, end), ...] [s]; arguments as in `Evidence.of`."""
    begin, end = window
    known = time[finite & (time >= begin) & (time <= end)]
    edges = np.concatenate([[begin], known, [end]])
    long = np.flatnonzero(np.diff(edges) > max_gap + JITTER)
    return [(float(edges[k]), float(edges[k + 1])) for k in long]
