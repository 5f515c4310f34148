"""Joint stops act only once the joint has been inside its range: a start outside, as the thesis does at q = 0, leaves
them open until then."""

from collections.abc import Sequence


class StopMemory:
    """Remembers which stops are still open.

    Args:
        limits: (lower, upper) per joint [rad or m], infinite where there is no stop.

    Attributes:
        waiting: for each joint that started outside, by its place: whether it is (below, above) and that stop therefore
            open.
    """

    def __init__(self, limits: Sequence[tuple[float, float]]) -> None:
        self.limits = list(limits)
        self.waiting: dict[int, tuple[bool, bool]] = {}

    def restart(self, q: Sequence[float]) -> set[int]:
        """The robot was put at q from outside: decide again which stops act. Returns the joints whose stops may have
        changed."""
        before = set(self.waiting)
        self.waiting = {
            i: (x < low, x > high)
            for i, (x, (low, high)) in enumerate(zip(q, self.limits, strict=True))
            if not low <= x <= high
        }
        return before | set(self.waiting)

    def check(self, q: Sequence[float]) -> list[int]:
        """Let a waiting stop act as soon as the joint is inside its range. Returns the joints whose stops act from now
        on."""
        inside = [i for i in self.waiting if self.limits[i][0] <= q[i] <= self.limits[i][1]]
        for i in inside:
            del self.waiting[i]
        return inside
