"""Errors of the plant, and their texts."""

import pytest
from two_link import two_link_urdf

from hric_control.plant import Load
from hric_core.errors import HricError, UnknownNameError
from opensim_ros_control.plant import OpenSimPlant

JOINTS = ["joint1", "joint2"]
EVERY = pytest.mark.parametrize(
    "config",
    [{"rotor_inertia": 0.0}, {"rotor_inertia": 0.1}, {"rotor_inertia": 0.0, "integrator": "semi_implicit"}],
    ids=["manager", "rotors", "semi_implicit"],
)


@EVERY
def test_a_command_that_is_not_finite_is_reported_and_not_passed_on(make_plant, config):
    plant = make_plant(two_link_urdf(), JOINTS, **config)
    plant.apply([float("nan"), 0.0])
    with pytest.raises(HricError, match="diverged"):
        plant.step()


@EVERY
def test_a_robot_that_flies_apart_is_reported(make_plant, config):
    plant = make_plant(
        two_link_urdf(limit='lower="-2" upper="2" effort="1e12" velocity="5"'), JOINTS, friction="none", **config
    )
    with pytest.raises(HricError, match=r"diverged|integrator failed in a step"):
        for _ in range(2000):
            dq = plant.engine_state()[1]
            plant.apply([1e6 * dq[0] + 1e3, 1e6 * dq[1]])
            plant.step()


@pytest.mark.parametrize(
    ("config", "word"),
    [
        ({"integrator": "euler"}, "accurate, semi_implicit"),
        ({"accuracy": 0.0}, "plant/accuracy"),
        ({"effort_limits": 1}, "plant/effort_limits"),
        ({"gui": True}, "plant/gui is True; valid: false"),
        ({"armature": 0.1}, "armature"),
        ({"friction": "identified"}, "friction_parameters"),
        ({"rotor_inertia": {"joint9": 0.1}}, "joint9"),
    ],
)
def test_a_wrong_parameter_is_refused_with_its_name(config, word):
    with pytest.raises(HricError, match=word):
        OpenSimPlant(two_link_urdf(), JOINTS, config)


def test_what_the_other_engine_knows_besides_is_accepted(make_plant):
    make_plant(
        two_link_urdf(),
        JOINTS,
        half_step_readout=False,
        self_collision=False,
        collision=False,
        contact_stiffness=1e4,
        seed=3,
        gui=False,
    )


def test_wrong_joints_loads_and_poses_are_refused_with_names(make_plant):
    with pytest.raises(UnknownNameError, match="joint3"):
        OpenSimPlant(two_link_urdf(), ["joint1", "joint3"], {})
    plant = make_plant(two_link_urdf(), JOINTS)
    with pytest.raises(UnknownNameError, match="link7"):
        plant.set_load(Load(1.0), "link7")
    with pytest.raises(HricError, match="mass"):
        plant.set_load(Load(-1.0))
    for call in (plant.apply, plant.set_brakes, plant.reset, plant.set_configuration, plant.set_modes):
        with pytest.raises(HricError, match="joint1, joint2"):
            call([0.0])
    with pytest.raises(HricError, match="finite"):
        plant.reset([0.0, float("inf")])
    with pytest.raises(UnknownNameError, match="link9"):
        plant.link_state("link9")


def test_a_description_that_cannot_be_carried_is_refused_with_its_element():
    floating = two_link_urdf().replace('<joint name="joint2" type="revolute">', '<joint name="joint2" type="floating">')
    with pytest.raises(HricError, match="joint2"):
        OpenSimPlant(floating, ["joint1"], {})
    weightless = two_link_urdf().replace('<mass value="2.0"/>', '<mass value="0"/>')
    with pytest.raises(HricError, match="link"):
        OpenSimPlant(weightless, JOINTS, {})
