"""Processor time as a ratio to a reference in the same run, since an absolute time depends on the machine."""

import statistics
import time
from collections.abc import Callable


def seconds(work: Callable[[], object], times: int) -> float:
    """Return the mean processor time of a call in this thread [s]."""
    begin = time.thread_time()
    for _ in range(times):
        work()
    return (time.thread_time() - begin) / times


def cost_ratio(
    work: Callable[[], object], reference: Callable[[], object], times: int = 100, rounds: int = 101
) -> float:
    """Return the processor time of `work` divided by that of `reference` [1].

    It is the median over rounds in which both are called `times` times.
    """
    return statistics.median(seconds(work, times) / seconds(reference, times) for _ in range(rounds))
