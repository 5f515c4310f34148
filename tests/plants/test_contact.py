"""Contact forces compared with closed formulas."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from rigid_body_oracle import Oracle

STIFFNESS, MASS, SPEED = 75000.0, 5.0, 0.25
PRESS_POSE = [0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.785]


def write_world(folder, *objects):
    path = folder / "world.yaml"
    path.write_text(yaml.safe_dump({"objects": list(objects)}))
    return str(path)


def sphere_against_wall(folder, gap, **wall):
    ball = {
        "name": "ball",
        "shape": "sphere",
        "size": 0.05,
        "mass": MASS,
        "friction": 0.0,
        "velocity": {"linear": [SPEED, 0, 0]},
    }
    place = {"xyz": [2.0 - 0.05 - gap, 0.0, 1.0]}
    block = {
        "name": "wall",
        "shape": "box",
        "size": [1.0, 1.0, 1.0],
        "pose": {"xyz": [2.5, 0.0, 1.0]},
        "friction": 0.0,
        **wall,
    }
    return write_world(folder, {**ball, "pose": place}, block)


def peak_force(plant, steps):
    peak = 0.0
    for _ in range(steps):
        plant.apply([0.0] * 7)
        plant.step()
        peak = max([peak, *(contact.force for contact in plant.contacts())])
    return peak


@pytest.mark.parametrize("gap", [0.001, 0.00113])
def test_a_sphere_has_the_analytic_peak(make_plant, panda_urdf, tmp_path, gap):
    world = sphere_against_wall(tmp_path, gap, contact="penalty", stiffness=STIFFNESS)
    plant = make_plant(panda_urdf, world=world, gravity=[0.0, 0.0, 0.0], q=PRESS_POSE)
    peak = peak_force(plant, 60)
    expected = SPEED * math.sqrt(MASS * STIFFNESS)
    print(gap, peak, peak / expected - 1)
    assert expected == pytest.approx(153.1, abs=0.05)
    assert peak == pytest.approx(expected, rel=0.02)
    leaving = plant.link_state("ball::link")[1]
    assert leaving[0] == pytest.approx(-SPEED, rel=0.02)


def test_contacts_of_a_deleted_model_are_gone(make_plant, panda_urdf, tmp_path):
    world = sphere_against_wall(tmp_path, 0.0, contact="penalty", stiffness=STIFFNESS)
    plant = make_plant(panda_urdf, world=world, gravity=[0.0, 0.0, 0.0], q=PRESS_POSE)
    assert peak_force(plant, 5) > 1.0
    plant.delete("wall")
    assert peak_force(plant, 3) == 0.0


def test_contact_damping_never_pulls(make_plant, panda_urdf, tmp_path):
    world = sphere_against_wall(tmp_path, 0.001, contact="penalty", stiffness=STIFFNESS, damping=300.0)
    plant = make_plant(panda_urdf, world=world, gravity=[0.0, 0.0, 0.0], q=PRESS_POSE)
    for _ in range(60):
        plant.apply([0.0] * 7)
        plant.step()
        assert all(contact.force >= 0.0 and contact.impulse > 0.0 for contact in plant.contacts())
    zeta = 300.0 / (2 * math.sqrt(MASS * STIFFNESS))
    restitution = -plant.link_state("ball::link")[1][0] / SPEED
    # Closed form for a force that may pull, e = exp(-pi zeta / sqrt(1 - zeta^2)); one that may not keeps a little more.
    assert math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)) * 0.97 < restitution < 0.85


def test_two_springs_act_in_series(make_plant, panda_urdf, tmp_path):
    world = sphere_against_wall(tmp_path, 0.001, contact="penalty", stiffness=2 * STIFFNESS)
    data = yaml.safe_load(Path(world).read_text())
    data["objects"][0].update(contact="penalty", stiffness=2 * STIFFNESS)
    plant = make_plant(panda_urdf, world=write_world(tmp_path, *data["objects"]), gravity=[0.0, 0.0, 0.0], q=PRESS_POSE)
    assert peak_force(plant, 60) == pytest.approx(SPEED * math.sqrt(MASS * STIFFNESS), rel=0.02)


def press(plant, oracle, force, seconds):
    """Apply joint torques J'F for a downward force at the tip, with gravity compensation and slight damping.

    Returns:
        sum of the contact forces in each of the last 100 steps, vertical parts of the contact normals in these steps,
        and the largest joint speed at the end.
    """
    q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    readings, normals = [], []
    for k in range(round(seconds / 1e-3)):
        plant.read_state(q, dq, tau)
        x, v = np.array(q), np.array(dq)
        twist = oracle.jacobian(x, "panda_hand_tcp")
        hold = -(twist.T @ (np.array([400.0, 400.0, 0.0, 30.0, 30.0, 30.0]) * error(oracle, x)))
        plant.apply(oracle.gravity(x) + twist[:3].T @ [0.0, 0.0, -force] - 4.0 * v + hold)
        plant.step()
        if k >= round(seconds / 1e-3) - 100:
            touching = [c for c in plant.contacts() if c.force > 0.0]
            readings.append(sum(c.force for c in touching))
            normals.append([abs(c.normal[2]) for c in touching])
    return np.array(readings), normals, np.abs(v).max()


def error(oracle, q):
    T = oracle.frame(q, "panda_hand_tcp")
    if not hasattr(oracle, "start"):
        oracle.start = T
    dR = T[:3, :3] @ oracle.start[:3, :3].T
    rotation = 0.5 * np.array([dR[2, 1] - dR[1, 2], dR[0, 2] - dR[2, 0], dR[1, 0] - dR[0, 1]])
    return np.concatenate([T[:3, 3] - oracle.start[:3, 3], rotation])


@pytest.mark.parametrize("contact", [{"contact": "rigid"}, {"contact": "penalty", "stiffness": 20000.0}])
@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_static_press_reads_its_force(make_plant, panda_urdf, tmp_path, contact, rotor):
    oracle = Oracle(panda_urdf)
    T = oracle.frame(np.array(PRESS_POSE), "panda_hand_tcp")
    top = T[2, 3] - 0.02
    place = {"xyz": [float(T[0, 3]), 0.0, float(top) - 0.05]}
    box = {"name": "box", "shape": "box", "size": [0.4, 0.4, 0.1], "pose": place, "friction": 0.3, **contact}
    plant = make_plant(panda_urdf, world=write_world(tmp_path, box), rotor_inertia=rotor, q=PRESS_POSE)
    readings, normals, speed = press(plant, oracle, 10.0, 3.0)
    print(contact, rotor, readings.mean(), np.ptp(readings), speed)
    assert readings.mean() == pytest.approx(10.0, rel=0.01)
    assert readings.std() < 0.2
    assert min(min(n) for n in normals) > 0.99


def test_resting_weight_is_read_exactly(make_plant, panda_urdf, tmp_path):
    floor = {"name": "floor", "shape": "plane", "pose": {"xyz": [0.0, 0.0, -0.5]}}
    block = {"name": "block", "shape": "box", "size": [0.1, 0.1, 0.1], "mass": 5.0, "pose": {"xyz": [1.0, 0.0, -0.45]}}
    plant = make_plant(panda_urdf, world=write_world(tmp_path, floor, block), q=PRESS_POSE)
    plant.set_brakes([True] * 7)
    for _ in range(1000):
        plant.apply([0.0] * 7)
        plant.step()
    forces = [c.force for c in plant.contacts() if "block::link" in (c.body_a, c.body_b)]
    assert sum(forces) == pytest.approx(5.0 * 9.81, rel=1e-6)


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_an_impact_conserves_link_and_rotor_momentum(make_plant, panda_urdf, tmp_path, rotor):
    """Check the impulse when a ball hits the hand.

    The joint momentum (M + B) dq afterwards equals the time integral of J'F with the reported contact force F.
    """
    oracle = Oracle(panda_urdf)
    q0 = np.array(PRESS_POSE)
    T = oracle.frame(q0, "panda_hand_tcp")
    x, z = float(T[0, 3]), float(T[2, 3]) - 0.04
    ball = {
        "name": "ball",
        "shape": "sphere",
        "size": 0.03,
        "mass": 1.0,
        "friction": 0.0,
        "pose": {"xyz": [x - 0.03, 0.0, z]},
    }
    ball |= {"velocity": {"linear": [0.5, 0.0, 0.0]}, "contact": "penalty", "stiffness": 20000.0}
    plant = make_plant(
        panda_urdf, world=write_world(tmp_path, ball), rotor_inertia=rotor, gravity=[0, 0, 0], q=PRESS_POSE
    )
    impulse = np.zeros(7)
    for k in range(300):
        plant.apply([0.0] * 7)
        q = np.array(plant.engine_state()[0])
        plant.step()
        for c in plant.contacts():
            sign = 1.0 if c.body_a.startswith("panda") else -1.0
            hand, J = oracle.frame(q, "panda_hand"), oracle.jacobian(q, "panda_hand")
            F = sign * c.impulse * np.array(c.normal)
            impulse += J.T @ np.concatenate([F, np.cross(np.array(c.position) - hand[:3, 3], F)])
        if k > 60 and not plant.contacts():
            break
    q, dq = map(np.array, plant.engine_state())
    scale = np.abs(impulse).max()
    assert scale > 0.03
    assert np.abs(oracle.mass_matrix(q) @ dq + rotor * dq - impulse).max() < 0.01 * scale
    if rotor:
        assert np.abs(oracle.mass_matrix(q) @ dq - impulse).max() > 0.04 * scale


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_the_arm_hits_with_its_effective_mass(make_plant, panda_urdf, tmp_path, rotor):
    """Check F = v sqrt(m k) with m = 1 / (n' J (M + B)^-1 J' n).

    This is the formula of ISO/TS 15066 with the reflected mass of the pose instead of the standard's estimate.
    """
    oracle, n, speed = Oracle(panda_urdf), np.array([1.0, 0.0, 0.0]), 0.25
    q = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
    T = oracle.frame(q, "panda_hand")
    # The hand's capsule: 0.035 m thick, its axis along y of the hand, 0.03 m before the hand's frame.
    touch = T[:3, 3] + 0.03 * T[:3, 2] + 0.035 * n
    J = oracle.jacobian(q, "panda_hand")
    row = n @ J[:3] + np.cross(touch - T[:3, 3], n) @ J[3:]
    inverse = np.linalg.inv(oracle.mass_matrix(q) + rotor * np.eye(7))
    mass = 1.0 / (row @ inverse @ row)
    # A ball in the place of the wall: it touches the hand's capsule in one known point.
    wall = {"name": "wall", "shape": "sphere", "size": 0.03, "pose": {"xyz": (touch + 0.0305 * n).tolist()}}
    wall |= {"contact": "penalty", "stiffness": STIFFNESS, "friction": 0.0}
    plant = make_plant(panda_urdf, world=write_world(tmp_path, wall), rotor_inertia=rotor, gravity=[0, 0, 0])
    plant.reset(q, mass * speed * inverse @ row)
    peak = peak_force(plant, 40)
    print(rotor, mass, peak, peak / (speed * math.sqrt(mass * STIFFNESS)) - 1)
    assert peak == pytest.approx(speed * math.sqrt(mass * STIFFNESS), rel=0.02)


@pytest.mark.parametrize("angle", [0.2, 0.4])
def test_a_block_slides_by_coulomb_friction(make_plant, panda_urdf, tmp_path, angle):
    """Check sliding: friction 0.6 * 0.5 = 0.3 holds up to 0.291 rad; above, the acceleration is g (sin - 0.3 cos)."""
    along, up = np.array([math.cos(angle), 0.0, -math.sin(angle)]), np.array([math.sin(angle), 0.0, math.cos(angle)])
    start = np.array([1.5, 0.0, 0.5]) + 0.05 * up
    slope = {
        "name": "slope",
        "shape": "plane",
        "pose": {"xyz": [1.5, 0.0, 0.5], "rpy": [0.0, angle, 0.0]},
        "friction": 0.6,
    }
    block = {"name": "block", "shape": "box", "size": [0.2, 0.2, 0.1], "mass": 2.0, "friction": 0.5}
    block |= {"pose": {"xyz": start.tolist(), "rpy": [0.0, angle, 0.0]}}
    plant = make_plant(panda_urdf, world=write_world(tmp_path, slope, block), q=PRESS_POSE, collision=False)
    plant.set_brakes([True] * 7)
    for _ in range(300):
        plant.apply([0.0] * 7)
        plant.step()
    T, twist = plant.link_state("block::link")
    acceleration = max(9.81 * (math.sin(angle) - 0.3 * math.cos(angle)), 0.0)
    assert twist[:3] @ along == pytest.approx(0.3 * acceleration, rel=0.01, abs=1e-4)
    assert abs((T[:3, 3] - start) @ up) < 1e-3


def gripper_urdf():
    """Return the URDF of two fingers of 0.1 kg that slide along y towards each other."""
    fingers = "".join(
        f"""<link name="{side}"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><box size="0.02 0.01 0.04"/></geometry></collision></link>
        <joint name="{side}_joint" type="prismatic"><parent link="base"/><child link="{side}"/><axis xyz="0 {sign} 0"/>
        <origin xyz="0 {-0.035 * sign} 1"/><limit lower="-0.1" upper="0.1" effort="100" velocity="1"/></joint>"""  # noqa: E501
        for side, sign in (("left", 1), ("right", -1))
    )
    return f'<robot name="gripper"><link name="base"/>{fingers}</robot>'


@pytest.mark.parametrize(("force", "holds"), [(15.0, True), (5.0, False)])
def test_fingers_hold_by_friction(make_plant, tmp_path, force, holds):
    """Check the grip of 0.5 kg between two fingers: friction 0.5 * 0.9 holds 4.9 N if F is at least 5.45 N."""
    block = {
        "name": "block",
        "shape": "box",
        "size": [0.05, 0.05, 0.05],
        "mass": 0.5,
        "friction": 0.9,
        "pose": {"xyz": [0.0, 0.0, 1.0]},
    }
    plant = make_plant(
        gripper_urdf(),
        ["left_joint", "right_joint"],
        world=write_world(tmp_path, block),
        q=[0.005, 0.005],
        rotor_inertia=0.0,
    )
    for _ in range(300):
        plant.apply([force, force])
        plant.step()
    drop = 1.0 - plant.link_state("block::link")[0][2, 3]
    assert drop < 1e-3 if holds else drop > 0.01
