"""Static and repeated muscle use: how long a posture is held, and how often a motion is repeated, from signals."""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hric_core.geometry import FloatArray

BLOCK = 0.2
"""Time over which a signal is averaged before its motion is counted [s] (project default, unconfirmed)."""
MINUTE = 60.0
"""Length of the time window in which repetitions are counted [s]."""


def held(time: FloatArray, signals: FloatArray, tolerance: float, duration: float) -> FloatArray:
    """Return how long all signals are held still at each instant, shape (n,) [s]; 0 if shorter than `duration`.

    Args:
        time: ascending times, shape (n,) [s].
        signals: k signals, shape (n, k); NaN is bridged by interpolation, a signal that is all NaN does not count.
        tolerance: maximum difference of two means over BLOCK while a signal is held, in its unit.
        duration: minimum duration of holding [s].
    """
    block, means = _blocks(time, signals)
    count = math.floor(duration / BLOCK) + 1
    if len(means) < count or not means.size:
        return np.zeros(len(time))
    windows = sliding_window_view(means, count, axis=0)
    still = (windows.max(axis=-1) - windows.min(axis=-1) <= tolerance).all(axis=1)
    covered = np.convolve(still, np.ones(count, dtype=np.int64)) > 0
    return np.asarray(np.where(covered, count * BLOCK, 0.0)[block])


def repeats(time: FloatArray, signals: FloatArray, amplitude: float) -> FloatArray:
    """Return the highest number of repetitions in any minute that contains each instant, shape (n,) [1/min].

    Args:
        time: ascending times, shape (n,) [s].
        signals: k signals, shape (n, k), as in `held`; the signal with the most repetitions counts.
        amplitude: minimum travel of a repeated motion in one direction, in the unit of the signals.
    """
    block, means = _blocks(time, signals)
    window = round(MINUTE / BLOCK)
    largest = np.zeros(len(means))
    for signal in means.T:
        done = np.zeros(len(means) + 2 * window)
        done[window + np.array(_moves(signal.tolist(), amplitude)[1::2], dtype=np.int64)] = 1.0
        counts = np.convolve(done, np.ones(window), "valid")  # of windows that begin at each block
        largest = np.maximum(largest, sliding_window_view(counts, window).max(axis=-1)[1 : len(means) + 1].round())
    return np.asarray(largest[block])


def wide(
    time: FloatArray, signal: FloatArray, travel: float, window: float
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return True for instants in a window in which a signal travels at least `travel`, shape (n,).

    Args:
        time: ascending times, shape (n,) [s].
        signal: signal, shape (n,); NaN is bridged by interpolation; one that is all NaN does not travel.
        travel: minimum travel, in the unit of the signal.
        window: length of the window [s].
    """
    block, means = _blocks(time, signal[:, None])
    if not means.size:
        return np.zeros(len(time), np.bool_)
    count = min(max(2, round(window / BLOCK)), len(means))
    windows = sliding_window_view(means[:, 0], count)
    far = windows.max(axis=-1) - windows.min(axis=-1) >= travel
    return np.asarray((np.convolve(far, np.ones(count, dtype=np.int64)) > 0)[block])


def _moves(signal: list[float], amplitude: float) -> list[int]:
    """Return the indices at which a signal has moved by `amplitude` since its last turn, up and down alternately."""
    moves, direction, low, high = list[int](), 0, signal[0], signal[0]
    for index, value in enumerate(signal):
        low, high = min(low, value), max(high, value)
        if direction <= 0 and value - low >= amplitude:
            direction, high = 1, value
        elif direction >= 0 and high - value >= amplitude:
            direction, low = -1, value
        else:
            continue
        moves.append(index)
    return moves


def _blocks(time: FloatArray, signals: FloatArray) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], FloatArray]:
    """Average signals over blocks of BLOCK seconds; return the block of each sample, (n,), and the means, (b, k).

    Blocks without a sample are interpolated.
    """
    time = np.cumsum(np.minimum(np.diff(time, prepend=time[0]), MINUTE))  # limits the memory after a jump of the stamps
    signals = signals[:, np.isfinite(signals).any(axis=0)]
    block = np.floor(time / BLOCK + 1e-6).astype(np.int64)
    means = np.empty((int(block[-1]) + 1, signals.shape[1]))
    for column, signal in enumerate(signals.T):
        known = np.isfinite(signal)
        count = np.bincount(block[known], minlength=len(means))
        total = np.bincount(block[known], signal[known], len(means))
        filled = np.flatnonzero(count)
        means[:, column] = np.interp(np.arange(len(means)), filled, total[filled] / count[filled])
    return block, means
