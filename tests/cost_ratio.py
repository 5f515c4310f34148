"""For tests of what something costs: processor time beside something else in the same run, since a time alone tells
more of the machine."""

import statistics
import time
from collections.abc import Callable


def seconds(work: Callable[[], object], times: int) -> float:
    """Mean processor time of this thread that a call takes [s]."""
    begin = time.thread_time()
    for _ in range(times):
        work()
    return (time.thread_time() - begin) / times


def cost_ratio(
    work: Callable[[], object], reference: Callable[[], object], times: int = 100, rounds: int = 101
) -> float:
    """Cost of `work` as a multiple of that of `reference`: median of rounds in which both are called `times` times
    [1]."""
    return statistics.median(seconds(work, times) / seconds(reference, times) for _ in range(rounds))
