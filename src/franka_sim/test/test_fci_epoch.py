"""The time of the run at which an arm's own time was 0, from pairs of clocks that come late and out of step."""

from itertools import pairwise

import pytest

from franka_sim.fci import epoch
from franka_sim.fci.epoch import Epoch

MS = 1_000_000
RUN = 1.7e9
"""Time of the run at the arm's 0 [s]."""


class Cell:
    """Arm with a driver; the test sets the clock of the machine [ns]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 5_000 * MS
        monkeypatch.setattr(epoch, "monotonic_ns", lambda: self.now)
        self.epoch, self.cycles, self.run = Epoch(12.0), 0, RUN

    def cycle(self, milliseconds: float = 1.0, n: int = 1) -> None:
        """Run cycles of the arm, each after a given time of the machine."""
        for _ in range(n):
            self.now += round(milliseconds * MS)
            self.cycles += 1
            self.epoch.on_cycle(self.cycles * 1e-3)

    def pair(self, behind: int = 0, late: float = 0.0) -> bool:
        """A pair from a driver that is so many states behind, delivered so many cycles later."""
        at, run = self.now + round(0.2 * MS), self.run + (self.cycles - behind) * 1e-3
        self.cycle(n=round(late))
        return self.epoch.on_pair(at, run)


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch) -> Cell:
    return Cell(monkeypatch)


def test_without_a_pair_it_is_what_was_given(cell: Cell) -> None:
    cell.cycle(n=3)
    assert cell.epoch.value == 12.0


@pytest.mark.parametrize("late", [0, 1, 50])
def test_the_first_pair_gives_it_to_the_rounding_of_stamps_however_late_it_comes(cell: Cell, late: int) -> None:
    cell.cycle(n=30)
    assert cell.pair(late=late)
    assert cell.epoch.value == pytest.approx(RUN, abs=1e-6)


def test_an_arm_that_goes_slower_than_the_wall_clock_keeps_it(cell: Cell) -> None:
    cell.cycle(n=20)
    cell.pair()
    for milliseconds in (1.0, 3.0, 17.0, 1.0):
        cell.cycle(milliseconds, n=20)
        assert not cell.pair()


def test_a_driver_that_is_behind_for_a_while_does_not_move_it(cell: Cell) -> None:
    cell.cycle(n=20)
    cell.pair()
    seen = [cell.epoch.value]
    for behind in (0, 1, 3, 2, 0, 1):
        cell.cycle(n=20)
        cell.pair(behind)
        seen.append(cell.epoch.value)
    assert all(before == after for before, after in pairwise(seen))


@pytest.mark.parametrize("jump", [0.010, -0.003])
def test_it_follows_a_driver_that_sets_its_stamps_anew(cell: Cell, jump: float) -> None:
    for _ in range(60):
        cell.cycle(n=20)
        cell.pair()
    cell.run += jump
    for _ in range(60):
        cell.cycle(n=20)
        cell.pair()
    assert cell.epoch.value == pytest.approx(RUN + jump, abs=1e-6)


def test_a_pair_from_before_the_arm_began_says_nothing(cell: Cell) -> None:
    cell.cycle()
    assert not cell.epoch.on_pair(cell.now - 10 * MS, RUN)
