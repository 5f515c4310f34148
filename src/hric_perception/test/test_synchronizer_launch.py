"""synchronizer.launch, read without a master, and the plan of a data collection."""

from pathlib import Path
from typing import Any

import pytest
import roslaunch.config
from roslaunch.core import RLException

from hric_perception.emg.muscles import MUSCLES
from hric_perception.sync.layout import read_plan

FILE = Path(__file__).parents[1] / "launch" / "synchronizer.launch"


def loaded(*arguments: str) -> Any:
    return roslaunch.config.load_config_default(
        [(str(FILE), list(arguments))], None, verbose=False, assign_machines=False
    )


def values(config: Any) -> dict[str, Any]:
    """Parameters by full name; mappings taken apart, as the server does."""
    found: dict[str, Any] = {}
    for name, parameter in config.params.items():
        mapping = parameter.value if isinstance(parameter.value, dict) else {}
        found |= {f"{name}/{key}": value for key, value in mapping.items()} or {name: parameter.value}
    return found


def test_the_plan_of_a_data_collection_is_valid_and_knows_its_units_and_muscles() -> None:
    found = {
        name.removeprefix("/synchronizer/plan/"): value
        for name, value in values(loaded()).items()
        if name.startswith("/synchronizer/plan/")
    }
    plan = read_plan("plan", found)
    units = {
        name: column.unit
        for name, column in zip(plan.names, (one for source in plan.sources for one in source.columns), strict=True)
    }
    assert {"rad", "rad/s", "N m", "m", "1", "N"} <= set(units.values())
    assert all(f"hric/perception/emg/raw.data[{muscle}]" in units for muscle in MUSCLES)


def test_the_rate_of_the_command_line_replaces_that_of_the_file() -> None:
    config = loaded("rate:=1000", "topic:=/other", "name:=fast")
    found = values(config)
    assert (
        found["/fast/plan/rate"] == 1000.0
        and found["/fast/topic"] == "/other"
        and len(found["/fast/plan/sources"]) == 4
    )


@pytest.mark.parametrize(("given", "node"), [("python", "synchronizer"), ("cpp", "synchronizer_cpp")])
def test_the_implementation_in_cpp_is_still_accepted(given: str, node: str) -> None:
    assert [one.type for one in loaded(f"implementation:={given}").nodes] == [node]


def test_an_implementation_that_does_not_exist_stops_the_launch() -> None:
    with pytest.raises(RLException, match="java"):
        loaded("implementation:=java")
