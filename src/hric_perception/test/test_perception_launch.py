"""The launch file, without a master: what starts, with which parameters."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import roslaunch.config

FILE = Path(__file__).parents[1] / "launch" / "perception.launch"


def loaded(*arguments: str) -> tuple[set[str], dict[str, object]]:
    config = roslaunch.config.load_config_default(
        [(str(FILE), list(arguments))], None, verbose=False, assign_machines=False
    )
    return {node.name for node in config.nodes}, {name: parameter.value for name, parameter in config.params.items()}


def test_nothing_starts_that_is_not_requested() -> None:
    assert loaded()[0] == set()
    names, values = loaded("emg:=trigno", "trigno:={host: 10.0.0.2}")
    assert names == {"emg"} and (values["/emg/source"], values["/emg/trigno/host"], values["/emg/lsl/session"]) == (
        "trigno",
        "10.0.0.2",
        "",
    )


@pytest.mark.parametrize(("how", "plate"), [("lsl", "lsl"), ("trigno", "natnet")])
def test_emulated_devices_take_the_place_of_real_ones_by_one_argument_each(how: str, plate: str) -> None:
    given = (
        f"emg:={how}",
        "emg_emulated:=true",
        f"plate:={plate}",
        "plate_emulated:=true",
        "time_code:=true",
        "muscles:=[a, b]",
        "plate_id:=left",
    )
    names, values = loaded(*given)
    assert names == {"emg", "emulated_emg", "force_plate", "emulated_plate"}
    assert values["/emulated_emg/transport"] == values["/emg/source"] == how and values["/emulated_emg/muscles"] == [
        "a",
        "b",
    ]
    assert (
        values["/emulated_plate/transport"] == values["/force_plate/source"] == plate
        and values["/force_plate/id"] == "left"
    )
    assert values["/emulated_emg/session"] == values["/emg/lsl/session"] == values["/force_plate/lsl/session"] == "hric"
    assert values["/emulated_emg/faults/time_code"] is True and values["/emulated_plate/faults/time_code"] is True
    assert ("/force_plate/pose/xyz" in values) == (plate == "lsl")


def test_a_real_plate_in_the_frames_of_motive_needs_its_address() -> None:
    names, values = loaded("plate:=natnet", "natnet_server:=192.168.1.10")
    assert names == {"force_plate"} and values["/force_plate/natnet/server"] == "192.168.1.10"


def test_every_argument_is_explained() -> None:
    assert all(len(argument.get("doc", "")) > 10 for argument in ET.parse(FILE).getroot().findall("arg"))
