"""What this plant refuses: parameters, windows, descriptions."""

import pytest
from two_link import two_link_urdf

from hric_control.errors import DescriptionError, HricError

JOINTS = ["joint1", "joint2"]


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"time_stp": 1}, "unknown parameter time_stp; valid: .*time_step"),
        ({"time_step": 0}, "plant/time_step must be a positive number"),
        ({"friction": "sticky"}, "plant/friction must be one of none, coulomb, identified"),
        ({"friction": "identified"}, "needs friction_parameters"),
        ({"rotor_inertia": [0.1]}, "1 values for 2 joints"),
        ({"rotor_inertia": {"joint9": 0.1}}, "no joint 'joint9'"),
        ({"rotor_inertia": -0.1}, "must not be negative"),
        ({"gravity": 9.81}, "plant/gravity must be three numbers"),
        ({"gui": "yes"}, "plant/gui must be true or false"),
        ({"world": "package://nowhere/world.yaml"}, "no package 'nowhere'"),
    ],
)
def test_wrong_plant_parameters_are_refused(make_plant, config, message):
    with pytest.raises(HricError, match=message):
        make_plant(two_link_urdf(), JOINTS, **config)


def test_a_window_without_a_display_is_refused_and_the_process_lives(make_plant, monkeypatch):
    monkeypatch.setenv("DISPLAY", "")
    with pytest.raises(HricError, match="gui: true needs a display"):
        make_plant(two_link_urdf(), JOINTS, gui=True)
    monkeypatch.setenv("DISPLAY", ":4242")
    with pytest.raises(HricError, match="':4242'"):
        make_plant(two_link_urdf(), JOINTS, gui=True)


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        ("<robot", "not XML"),
        ("<sdf/>", "starts with <sdf>"),
        ("<robot name='a'/>", "no link"),
        ("<robot name='a'><link name='b'/><link name='c'/></robot>", "one root link; it has 2: b, c"),
        (two_link_urdf().replace('<mass value="2.0"/>', '<mass value="0"/>'), "link link1: it moves, but neither it"),
        (two_link_urdf(joint="planar"), "joint joint1: type 'planar' is not supported; valid: revolute"),
        (two_link_urdf(limit='lower="1" upper="-1"'), "joint joint1: lower limit 1.0 is above"),
        (two_link_urdf(axis="0 0 0"), "joint joint1: its axis is zero"),
        (two_link_urdf(axis="0 zero 0"), 'xyz="0 zero 0" must be 3 finite number'),
    ],
)
def test_a_bad_description_is_refused_by_the_name_of_the_element(make_plant, urdf, message):
    with pytest.raises(DescriptionError, match=message):
        make_plant(urdf, JOINTS)
