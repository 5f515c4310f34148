"""Time from a change in `hric try` to its figures, on a machine at rest."""

import statistics
import time
from collections.abc import Callable

import pytest

from hric_view.tryout import Tryout

pytestmark = [pytest.mark.alone, pytest.mark.live]


def test_a_change_has_its_figures_in_time(figure: Callable[..., None]) -> None:
    tryout = Tryout()
    tryout.result({})
    times = []
    for speed in (0.9, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7):
        begin = time.perf_counter()
        tryout.result({"speed": speed})
        times.append(time.perf_counter() - begin)
    tryout.close()
    figure("hric try: from a change to its figures, median of 7", statistics.median(times), "s")
    assert statistics.median(times) <= 1.5
