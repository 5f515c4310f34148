"""The launch file, without a master: what starts, with which parameters."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import roslaunch.config

from hric_core.command import main

FILE = Path(__file__).parents[1] / "launch" / "mocap.launch"


def loaded(*arguments: str) -> tuple[dict[str, str], dict[str, object]]:
    config = roslaunch.config.load_config_default(
        [(str(FILE), list(arguments))], None, verbose=False, assign_machines=False
    )
    return {node.name: node.args for node in config.nodes}, {
        name: parameter.value for name, parameter in config.params.items()
    }


def test_a_real_motive_needs_its_address_alone() -> None:
    nodes, values = loaded("server:=192.168.1.10")
    assert list(nodes) == ["natnet_client"]
    assert values["/natnet_client/server"] == "192.168.1.10" and values["/natnet_client/up_axis"] == "y"


def test_the_emulated_motive_takes_its_place_by_one_argument() -> None:
    nodes, values = loaded("server:=192.168.1.10", "emulated:=true", "up_axis:=z", "emulated_args:=--noise 1e-4")
    assert set(nodes) == {"natnet_client", "emulated_motive"}
    assert nodes["emulated_motive"].split() == ["--up", "z", "--noise", "1e-4"]
    assert values["/natnet_client/server"] == "127.0.0.1" and values["/natnet_client/up_axis"] == "z"


def test_a_calibration_names_base_and_place(tmp_path: Path) -> None:
    path = tmp_path / "base.yaml"
    path.write_text("base_frame: panda_link0\nbase_from_mocap: {xyz: [1, 2, 3], xyzw: [0, 0, 0, 1]}\n")
    _, values = loaded(f"calibration:={path}")
    assert values["/natnet_client/base_from_mocap/xyz"] == [1, 2, 3]
    assert values["/natnet_client/base_frame"] == "panda_link0"
    _, values = loaded(f"calibration:={path}", "base_frame:=world")
    assert values["/natnet_client/base_frame"] == "world"


def test_every_argument_is_explained() -> None:
    assert all(argument.get("doc") for argument in ET.parse(FILE).getroot().findall("arg"))


def test_the_names_that_roslaunch_adds_are_left_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(
            [
                "emulated_motive",
                "--clock",
                "wall",
                "--rate",
                "-1",
                "/tf:=tf",
                "__name:=emulated_motive",
                "__log:=/tmp/x.log",
            ]
        )
        == 2
    )
    assert "rate is -1" in capsys.readouterr().err
