"""Helpers of tests of clocks: a computed run on a busy machine, and a driver on that machine."""

import numpy as np

from hric_core.robot_time.clock import NS, RunClock

START = 40_000 * NS
CALM, END, OVER = 24.0, 30.0, 32.0
"""Times at which the load ends, the run is paused, and the last clock pair comes [s of wall time]."""


class BusyRun:
    """Control loop on a busy machine that interrupts it, and delivers its clock pairs late, in bunches, and twice.

    Args:
        seed: seed of all randomness.
        pace: requested robot time per wall time.
        load: 1: a stall of 5 to 400 ms about each 0.2 s, and a fifth of the pairs late by 100 ms; 0: none.

    Attributes:
        pairs: in order of delivery: (delivered, published [s of wall time], robot time [s]).
    """

    def __init__(self, seed: int, pace: float, load: float) -> None:
        self._random, self.pace, self._load = np.random.default_rng(seed), pace, load
        self.pairs: list[tuple[float, float, float]] = []
        self._work()
        self.pairs.sort(key=lambda pair: pair[0])

    def _work(self) -> None:
        """Advance like `SimLoop`: catch up at four times the pace, lose time beyond 0.1 s; one pair per 20 ms."""
        random, wall, run, due, told, delivered = self._random, 0.0, 0.0, 0.0, 0.0, 0.0
        while wall < END:
            load = self._load if wall < CALM else 0.0
            stalled = (
                float(np.exp(random.uniform(np.log(0.005), np.log(0.4)))) if random.random() < load * 0.005 else 0.0
            )
            wall += 1e-3 + stalled
            due += 1e-3 + stalled
            if due - run / self.pace > 0.1:
                due = run / self.pace
            run = min(run + 4e-3 * self.pace, due * self.pace)
            if wall >= told + 0.02:
                told = wall
                if random.random() < load * 0.2:  # the listener does not get to run, and hears all that waits at once
                    delivered = max(delivered, wall + float(random.exponential(0.1)))
                arrived = max(wall + float(random.exponential(3e-4)), delivered)
                self.pairs += [(arrived, wall, run)] * int(random.integers(1, 3))
        self.pairs += [(at, at, run) for at in np.arange(wall + 0.02, OVER, 0.02).tolist()]

    def truth(self, wall: np.ndarray) -> np.ndarray:
        """Return robot times at wall times [s], shape (n,) [s]."""
        told, run = np.array(sorted({(told, run) for _, told, run in self.pairs})).T
        return np.interp(wall, told, run)


class BusyDriver:
    """Driver that requests robot time some milliseconds after a measurement, with the pairs delivered until then.

    Args:
        busy: run whose clock pairs the driver receives.
    """

    def __init__(self, busy: BusyRun) -> None:
        self.clock = RunClock()
        self._pace, self._waiting = busy.pace, busy.pairs[::-1]
        self._random = np.random.default_rng(7)

    def robot_time(self, wall: float) -> float | None:
        """Return the robot time [s] at a wall time [s]; None while it is not known."""
        asked = wall + 0.0055 + float(self._random.exponential(2e-3))
        while self._waiting and self._waiting[-1][0] <= asked:
            _, told, run = self._waiting.pop()
            self.clock.add(START + round(told * NS), run, self._pace)
        at = START + round(wall * NS)
        self.clock.settle(at)
        return self.clock.robot_time(at)
