"""The command that measures FrankaHW by the wall clock: it runs, and what it tells fits together. The figures are the machine's."""

import pytest
from wall_clock import measure, report


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_figures_by_the_wall_clock_are_told_or_the_reflex_by_name(robot: str) -> None:
    found = measure(robot, 8.0)
    text = report(robot, found)
    print(text)
    assert all(0.0 <= rate <= 1.0 for rate in found.rates)
    assert found.seconds > 7.0 or found.stops
    assert all("communication_constraints_violation" in why and why in text for _, why in found.stops)
    assert ("survived" in text) == (not found.stops)
    assert sum(found.losses) >= sum(event.lost for event in found.events)
