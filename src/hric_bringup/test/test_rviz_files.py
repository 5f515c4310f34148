"""The rviz configurations: there are two, since a display of who is not there would be an error on the screen."""

from pathlib import Path
from typing import Any

import yaml

FOLDER = Path(__file__).parents[1] / "rviz"


def shown(name: str) -> dict[str, Any]:
    return dict(yaml.safe_load((FOLDER / f"{name}.rviz").read_text()))


def test_the_view_with_a_human_differs_from_the_other_by_them_and_by_where_one_looks_from() -> None:
    alone, beside = shown("panda"), shown("panda_and_human")
    displays = beside["Visualization Manager"]["Displays"]
    (human,) = [display for display in displays if display["Name"] == "Human"]
    displays.remove(human)
    for both in (alone, beside):
        view = both["Visualization Manager"]["Views"]["Current"]
        del view["Distance"], view["Focal Point"]
    assert alone == beside
    assert [display["Class"] for display in human["Displays"]] == ["rviz/RobotModel", "rviz/Marker", "rviz/MarkerArray"]
