"""Parameters, windows and descriptions that this plant refuses."""

import pytest
from two_link import two_link_urdf

from hric_core.errors import DescriptionError, HricError

JOINTS = ["joint1", "joint2"]


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"time_stp": 1}, r"no parameter 'time_stp' in plant; valid: .*time_step"),
        ({"time_step": 0}, r"plant/time_step is 0; valid: a finite number above 0 to 0\.1 \[s\]"),
        ({"friction": "sticky"}, "plant/friction is 'sticky'; valid: none, coulomb, identified"),
        ({"friction": "identified"}, "needs friction_parameters"),
        ({"rotor_inertia": [0.1]}, r"plant/rotor_inertia is \[0.1\]; valid: 2 values, for joint1, joint2"),
        ({"rotor_inertia": {"joint9": 0.1}}, "no joint 'joint9'"),
        ({"rotor_inertia": -0.1}, "plant/rotor_inertia is -0.1; valid: a finite number of 0 or more"),
        ({"gravity": 9.81}, "plant/gravity is 9.81; valid: three finite numbers, 10 at most in size"),
        ({"gui": "yes"}, "plant/gui is 'yes'; valid: true or false"),
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
        (
            two_link_urdf().replace('<mass value="2.0"/>', '<mass value="0"/>'),
            "link link1: it can move, but neither it",
        ),
        (two_link_urdf(joint="planar"), "joint joint1: type 'planar' is not supported by PyBullet; valid: revolute"),
    ],
)
def test_what_the_engine_cannot_hold_is_refused_by_the_name_of_the_element(make_plant, urdf, message):
    with pytest.raises(DescriptionError, match=message):
        make_plant(urdf, JOINTS)
