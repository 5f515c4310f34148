"""Static friction on every engine: bristle friction of joints, and friction of penalty contacts."""

import math

import numpy as np
import pytest
import yaml
from two_link import two_link_urdf

from hric_control.plants.friction import FADE, GIVE, sigmoid_torque

JOINTS = ["joint1", "joint2"]
PHI = {"phi1": 0.6, "phi2": 8.0, "phi3": 0.03}
BREAKAWAY = 1.2
STILL = {"gravity": [0.0, 0.0, 0.0], "collision": False}
FRICTION = {"friction": "identified", "friction_parameters": {name: {**PHI, "breakaway": BREAKAWAY} for name in JOINTS}}
FORMS = [{}, {"rotor_inertia": 0.0}, {"integrator": "semi_implicit"}, {"time_step": 2.5e-4}]


def state(plant):
    rows = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
    plant.read_state(*rows)
    return [np.array(row) for row in rows]


def pushed(plant, efforts):
    """Return positions and speeds after each of the steps, shape (m, 2) each."""
    course = []
    for effort in efforts:
        plant.apply([effort, 0.0])
        plant.step()
        course.append(state(plant)[:2])
    return np.array(course).swapaxes(0, 1)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_a_joint_gives_a_little_up_to_its_breakaway_and_slides_beyond(make_plant, form):
    """Check that the joint holds 0.98 of its friction torque, not 1.02, and deflects like a spring."""
    plant = make_plant(two_link_urdf(axis="0 0 1"), JOINTS, q=[0.3, 0.2], **STILL, **FRICTION, **form)
    dt = plant.time_step
    ramp = np.arange(0.0, 0.98 * BREAKAWAY, 4.0 * dt)
    up, _ = pushed(plant, ramp)
    assert up[len(ramp) // 2, 0] - 0.3 == pytest.approx(0.49 * GIVE, rel=0.05)
    held, _ = pushed(plant, [0.98 * BREAKAWAY] * round(0.3 / dt))
    assert 0.97 * GIVE < held[-1, 0] - 0.3 < 1.1 * GIVE and abs(held[-1, 0] - held[len(held) // 2, 0]) < 0.05 * GIVE
    slid, _ = pushed(plant, [1.02 * BREAKAWAY] * round(0.3 / dt))
    assert slid[-1, 0] - 0.3 > 3.0 * GIVE


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_the_bristles_of_joints_take_energy_on_any_drive_and_forget_with_a_reset(make_plant, rng, form):
    plant = make_plant(two_link_urdf(axis="0 0 1"), JOINTS, q=[0.3, 0.2], **STILL, **FRICTION, **form)
    efforts = np.repeat(rng.normal(0.0, 2.0 * BREAKAWAY, 300), 5)
    courses = []
    for _ in range(2):
        plant.reset([0.3, 0.2])
        courses.append(pushed(plant, efforts))
    assert np.array_equal(*courses)
    q, v = courses[0]
    work = np.cumsum(efforts * np.diff(q[:, 0], prepend=0.3))
    kinetic = []
    for position, speed in zip(q[::50], v[::50], strict=True):
        plant.set_configuration(position)
        M = plant.mass_matrix() + np.diag(plant.config.rotor_inertia)
        kinetic.append(0.5 * speed @ M @ speed)
    taken = work[::50] - kinetic
    # The first steps at rest take no more than the bristles store; from then on friction has taken the rest.
    assert taken.min() > -0.02 * np.abs(work).max() and taken[-1] > 0.1 * np.abs(work).max()


def test_a_fast_joint_has_the_identified_friction_alone(make_plant):
    """Check that above the speed FADE, where the bristle force is zero, the motion is bitwise that without bristles."""
    without = {**FRICTION, "friction_parameters": {name: PHI for name in JOINTS}}
    courses = []
    for friction in (FRICTION, without):
        plant = make_plant(two_link_urdf(axis="0 0 1"), JOINTS, **STILL, **friction)
        plant.reset([0.3, 0.2], [2.0, -1.5])
        courses.append(pushed(plant, [0.5] * 200))
    assert np.abs(courses[0][1]).min() > FADE
    assert np.array_equal(*courses)
    assert sigmoid_torque(np.array([2.0]), tuple(PHI.values()))[0] > 0.1


def test_a_joint_that_is_pushed_in_turns_below_its_breakaway_stays(make_plant):
    plant = make_plant(two_link_urdf(axis="0 0 1"), JOINTS, q=[0.3, 0.2], **STILL, **FRICTION)
    efforts = BREAKAWAY * (0.4 + 0.3 * np.sin(2.0 * np.pi * 20.0 * 1e-3 * np.arange(4000)))
    q, _ = pushed(plant, efforts)
    assert abs(q[3000:, 0].mean() - q[1000:2000, 0].mean()) < 1e-8
    assert np.abs(q[:, 0] - 0.3).max() < GIVE


@pytest.mark.parametrize(
    ("seconds", "stiffness"), [(3.0, 75000.0), pytest.param(10.0, 75000.0, marks=pytest.mark.slow)]
)
def test_a_block_at_half_the_onset_angle_stays_on_its_spring(make_plant, panda_urdf, tmp_path, seconds, stiffness):
    """Check friction 0.6 * 0.5 = 0.3, from the static depth; while it settles the body may slide 0.1 mm."""
    angle = 0.5 * math.atan(0.3)
    along, up = np.array([math.cos(angle), 0.0, -math.sin(angle)]), np.array([math.sin(angle), 0.0, math.cos(angle)])
    place = {"rpy": [0.0, angle, 0.0]}
    surface = {"contact": "penalty", "stiffness": stiffness, "damping": 200.0}
    start = np.array([1.5, 0.0, 0.5]) + 0.0495 * up
    slope = {"name": "slope", "shape": "plane", "pose": {"xyz": [1.5, 0.0, 0.5], **place}, "friction": 0.6, **surface}
    block = {"name": "block", "shape": "box", "size": [0.2, 0.2, 0.1], "mass": 2.0, "friction": 0.5, **surface}
    world = tmp_path / "world.yaml"
    world.write_text(yaml.safe_dump({"objects": [slope, {**block, "pose": {"xyz": start.tolist(), **place}}]}))
    plant = make_plant(panda_urdf, world=str(world), collision=False)
    plant.set_brakes([True] * 7)
    ways = []
    for _ in range(round(seconds * 1000)):
        plant.apply([0.0] * 7)
        plant.step()
        ways.append((plant.link_state("block::link")[0][:3, 3] - start) @ along)
    print(f"along the slope: {1e3 * ways[999]:.4f} mm after 1 s, {1e3 * ways[-1]:.4f} mm after {seconds:g} s")
    assert np.abs(ways).max() < 1e-4
    assert abs(ways[-1] - ways[999]) < 1e-5
