"""Two arms in one plant: their collision against a closed form on every engine, and an arm beside another as alone.

The hands move towards each other along a line with the least energy. Both arms are one mass each on the spring of the
hands' surfaces, 1 / (n' J (M + B)^-1 J' n) at the contact along its normal, which gives the peak v sqrt(mu k) and the
impulse 2 mu v. Gravity is off, and only the hands have a shape. What the arms turn while they touch is neglected: this
changes the impulse by up to 0.8 % at 1 m/s, the peak by less than 0.1 %.
"""

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from rigid_body_oracle import Oracle

import panda_description
from hric_core.urdf import read
from hric_core.urdf.combining import combined

READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
ARMS = ("left", "right")
JOINTS = [f"{arm}_joint{number}" for arm in ARMS for number in range(1, 8)]
ROTOR, STIFFNESS, GAP = 0.1, 2e4, 2e-4
"""Rotor inertia [kg m^2]; stiffness of both hands together [N/m]; distance of the hands at the start [m]."""
P_HAND_CAPSULE, RADIUS = (0.0, 0.0, 0.03), 0.035
"""Middle of the hand's capsule in the hand's frame, and its radius [m]."""
ALLOWED = 1.0
"""Allowed error of peak force and impulse [%]."""


def arm(name, inertials="barycentric", xyz="0 0 0", rpy="0 0 0", hand_only=True):
    urdf = panda_description.load(arm_id=name, meshes=False, inertials=inertials, xyz=xyz, rpy=rpy)
    robot = ElementTree.fromstring(urdf)
    for link in robot.findall("link"):
        for shape in link.findall("collision") if hand_only and link.get("name") != f"{name}_hand" else ():
            link.remove(shape)
    return ElementTree.tostring(robot, encoding="unicode")


class Hitting:
    """Arm in front of a contact point of its hand, in a library: its mass there and the speeds that move the point."""

    def __init__(self, name, urdf, normal):
        oracle = Oracle(urdf, rotor_inertia=ROTOR)
        T = oracle.frame(READY, f"{name}_hand")
        point = (T @ [*P_HAND_CAPSULE, 1.0])[:3] + RADIUS * np.array(normal)
        J = oracle.jacobian(READY, f"{name}_hand")
        row = normal @ J[:3] + np.cross(point - T[:3, 3], normal) @ J[3:]
        inverse = np.linalg.inv(oracle.mass_matrix(READY) + ROTOR * np.eye(7))
        self.mass = 1.0 / (row @ inverse @ row)
        self.at_1_m_s = self.mass * inverse @ row
        self.point = point


@pytest.mark.parametrize("inertials", ["barycentric", "fr3"])
@pytest.mark.parametrize("speed", [0.25, 0.5, 1.0])
def test_two_arms_collide_as_two_masses_on_a_spring(make_plant, inertials, speed):
    left = Hitting("left", arm("left"), (1.0, 0.0, 0.0))
    place = {"xyz": f"{2 * left.point[0] + GAP} 0 0", "rpy": f"0 0 {math.pi}"}
    right = Hitting("right", arm("right", inertials, **place), (-1.0, 0.0, 0.0))
    urdf = combined("arms", {"left": arm("left"), "right": arm("right", inertials, **place)})
    soft = {"link": "arms::*_hand", "contact": "penalty", "stiffness": 2 * STIFFNESS, "friction": 0.0}
    plant = make_plant(urdf, JOINTS, gravity=[0.0, 0.0, 0.0], rotor_inertia=ROTOR, surfaces=[soft])
    mu = left.mass * right.mass / (left.mass + right.mass)
    shares = [speed * mu / one.mass for one in (left, right)]  # no momentum in sum
    plant.reset([*READY, *READY], [*(shares[0] * left.at_1_m_s), *(shares[1] * right.at_1_m_s)])
    peak = impulse = 0.0
    for _ in range(80):
        plant.apply([0.0] * 14)
        plant.step()
        for contact in plant.contacts():
            assert {contact.body_a, contact.body_b} == {"arms::left_hand", "arms::right_hand"}
            assert contact.kind == "penalty"
            peak, impulse = max(peak, contact.force), impulse + contact.impulse
    assert 100 * abs(peak / (speed * math.sqrt(mu * STIFFNESS)) - 1) < ALLOWED
    assert 100 * abs(impulse / (2 * mu * speed) - 1) < ALLOWED


def test_masks_of_an_arm_leave_contact_between_arms(make_plant):
    """`*_link5` and `*_link7` are masked within an arm; here link 5 of one arm is where link 7 of the other is."""
    poses = read(arm("left")).poses(dict(zip(JOINTS[:7], READY, strict=True)))
    shift = poses["left_link5"][:3, 3] - poses["left_link7"][:3, 3]
    places = {"left": "0 0 0", "right": " ".join(map(str, shift))}
    urdfs = {name: arm(name, xyz=place, hand_only=False) for name, place in places.items()}
    soft = {"link": "arms::*", "contact": "penalty", "stiffness": 100.0}
    plant = make_plant(combined("arms", urdfs), JOINTS, gravity=[0.0, 0.0, 0.0], surfaces=[soft])
    plant.reset([*READY, *READY])
    plant.apply([0.0] * 14)
    plant.step()
    pairs = {frozenset((c.body_a.partition("::")[2], c.body_b.partition("::")[2])) for c in plant.contacts()}
    assert frozenset(("left_link5", "right_link7")) in pairs
    assert all(len({link.partition("_")[0] for link in pair}) == 2 for pair in pairs), "none within an arm"
    assert frozenset(("left_link0", "right_link0")) not in pairs, "both are fixed"


def test_an_arm_beside_another_moves_as_alone(make_plant):
    """With gravity and torques; the arms do not touch."""
    alone = make_plant(arm("left"), JOINTS[:7], q=READY)
    urdfs = {"left": arm("left"), "right": arm("right", "fr3", xyz="0 2 0")}
    both = make_plant(combined("arms", urdfs), JOINTS, q=[*READY, *READY])
    for k in range(200):
        tau = [3.0 * math.sin(0.01 * k * (j + 1)) for j in range(7)]
        alone.apply(tau)
        both.apply([*tau, *reversed(tau)])
        alone.step()
        both.step()
    states = [([0.0] * n, [0.0] * n, [0.0] * n) for n in (7, 14)]
    for plant, state in zip((alone, both), states, strict=True):
        plant.read_state(*state)
    for one, two in zip(*states, strict=True):
        assert two[:7] == pytest.approx(one, abs=1e-7)
    assert abs(states[1][0][7] - states[1][0][0]) > 1e-3
    assert read(urdfs["left"]).arms() == {}
