"""Processor time of posture scoring as a share of the recorded time."""

import time
from collections.abc import Callable

import numpy as np
import pytest

from hric_assessment.ergonomics import Posture, reba, rula
from hric_assessment.ergonomics.posture import ANGLES
from hric_assessment.separation.minima import separation

pytestmark = pytest.mark.alone

MINUTE = 60.0
"""Duration of the recorded run [s]; a recorded minute may take 6 s of processor time in total."""


def share(work: Callable[[], object]) -> float:
    """Return the processor time of a call as share of a recorded minute, the minimum of several calls [1]."""
    found = []
    for _ in range(3):
        begin = time.process_time()
        work()
        found.append((time.process_time() - begin) / MINUTE)
    return min(found)


def test_rula_and_reba_of_a_minute_at_100_hz_cost_less_than_a_thousandth_of_it_each() -> None:
    random = np.random.default_rng(0)
    posture = Posture(**{name: random.uniform(-1.0, 1.5, 6000) for name in ANGLES})
    for method in (rula, reba):
        cost = share(lambda method=method: method.score(posture))  # type: ignore[misc]
        print(f"{method.__name__} of a minute at 100 Hz: {1e3 * MINUTE * cost:.1f} ms of processor")
        assert cost < 1e-3


def test_the_separation_of_an_arm_and_a_whole_body_costs_less_than_a_twentieth_of_the_time() -> None:
    random = np.random.default_rng(2)
    middle, half, swing = random.uniform(-0.5, 0.5, (3, 28, 1, 3)) * np.array([1.0, 0.3, 0.4])[:, None, None, None]
    ends = np.concatenate([middle - half, middle + half], axis=1)
    ends[8:] += np.array([1.0, 0.0, 0.0])

    def moved(chosen: slice) -> Callable[[np.ndarray], np.ndarray]:
        return lambda t: ends[chosen] + swing[chosen] * np.sin(3.0 * t[:, None, None, None])

    arm, person = moved(slice(8)), moved(slice(8, None))
    cost = share(lambda: separation(0.0, MINUTE, arm, np.full(8, 0.06), person, np.full(20, 0.05)))
    print(f"separation over a minute: {1e3 * MINUTE * cost:.0f} ms of processor")
    assert cost < 0.05
