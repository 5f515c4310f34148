"""Penalty contact against closed formulas, as one table per engine: errors of peak force, impulse and energy [%].
Printed by `pytest -s`.

A body that meets a fixed spring with speed v gives the peak v sqrt(m k) and the impulse 2 m v and leaves with the
energy that it came with; of an arm, m is 1 / (n' J (M + B)^-1 J' n) (ISO/TS 15066 with the reflected mass of the pose
in place of its rule of thumb). An arm turns while it touches: what it gives to a ball by then is told by a rigid-body
library, with the same spring, in steps of 20 us.
"""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
import yaml
from rigid_body_oracle import Oracle

STIFFNESS, STEP = 75000.0, 1e-3
POINT, FACE = 1.0, 3.0
"""Allowed errors of peak force and impulse for contact at a point, and of a face [%]."""
ENERGY = 1.0
"""Allowed gain or loss of energy [%]."""
MASSES, SPEEDS = (0.6, 5.0), (0.25, 1.0)
PARKED = [0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.785]
FRONT = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
TURNED = {
    "sphere": [0.0, 0.0, 0.0],
    "box": [0.0, 0.0, 0.0],
    "capsule": [0.0, 0.0, 0.0],
    "cylinder end": [0.0, math.pi / 2, 0.0],
}
SIZES = {
    "sphere": (0.05, 0.05),
    "box": ([0.1, 0.1, 0.1], 0.05),
    "capsule": ([0.03, 0.12], 0.03),
    "cylinder end": ([0.04, 0.1], 0.05),
}
"""Size of each shape, and distance of its centre from the contacting side [m]."""


class Errors(NamedTuple):
    """Errors of peak force, impulse and energy; for several phases the largest ones [%]."""

    peak: float
    impulse: float
    energy: float


def worst(rows):
    return Errors(*(max(column, key=abs) for column in zip(*rows, strict=True)))


@pytest.fixture(scope="module")
def table():
    rows = []
    yield rows
    print(
        f"\n{'engine':14} {'what meets the wall':24} {'B':>4} {'m [kg]':>7} {'v [m/s]':>8} {'peak %':>8} "
        f"{'impulse %':>10} {'energy %':>9}"
    )
    for engine, what, rotor, mass, speed, e in rows:
        print(
            f"{engine:14} {what:24} {rotor:4.1f} {mass:7.2f} {speed:8.2f} {e.peak:+8.3f} {e.impulse:+10.3f} "
            f"{e.energy:+9.3f}"
        )


def note(table, plant_type, what, rotor, mass, speed, errors, bound):
    table.append((plant_type.rpartition("/")[2], what, rotor, mass, speed, errors))
    assert max(abs(errors.peak), abs(errors.impulse)) < bound
    assert abs(errors.energy) < ENERGY


def write_world(folder, *objects):
    path = folder / "world.yaml"
    path.write_text(yaml.safe_dump({"objects": list(objects)}))
    return str(path)


def collide(plant, steps):
    """Return peak force [N] and impulse [N s] of the contacts during some steps."""
    peak = impulse = 0.0
    for _ in range(steps):
        plant.apply([0.0] * 7)
        plant.step()
        for contact in plant.contacts():
            assert contact.kind == "penalty"
            peak, impulse = max(peak, contact.force), impulse + contact.impulse
    return peak, impulse


def free_body(make_plant, panda_urdf, folder, shape, mass, speed, phase):
    """Let a body fly straight at a wall; `phase` is the fraction of a step at which it makes contact."""
    size, reach = SIZES[shape]
    gap = (3.0 + phase) * STEP * speed
    body = {"name": "body", "shape": shape.partition(" ")[0], "size": size, "mass": mass, "friction": 0.0}
    body |= {
        "velocity": {"linear": [speed, 0.0, 0.0]},
        "pose": {"xyz": [2.0 - reach - gap, 0.0, 1.0], "rpy": TURNED[shape]},
    }
    wall = {"name": "wall", "shape": "box", "size": [1.0, 1.0, 1.0], "pose": {"xyz": [2.5, 0.0, 1.0]}, "friction": 0.0}
    wall |= {"contact": "penalty", "stiffness": STIFFNESS}
    plant = make_plant(
        panda_urdf, world=write_world(folder, body, wall), gravity=[0.0, 0.0, 0.0], q=PARKED, collision=False
    )
    plant.set_brakes([True] * 7)
    peak, impulse = collide(plant, 12 + math.ceil(math.pi * math.sqrt(mass / STIFFNESS) / STEP))
    assert plant.contacts() == []
    twist = plant.link_state("body::link")[1]
    plant.close()
    energy = float(twist[:3] @ twist[:3]) / speed**2
    return Errors(
        *(
            100.0 * (x - 1.0)
            for x in (peak / (speed * math.sqrt(mass * STIFFNESS)), impulse / (2.0 * mass * speed), energy)
        )
    )


@functools.cache
def oracle_of(urdf, rotor):
    oracle = Oracle(urdf, rotor_inertia=rotor)
    oracle.model.gravity.linear = np.zeros(3)
    return oracle


def impulse_on_ball(urdf, rotor, start, centre):
    """Return the impulse of the hand's capsule on a fixed ball [N s], by leapfrog with 20 us and pinocchio."""
    oracle, h = oracle_of(urdf, rotor), 2e-5
    q, dq, impulse, touched = FRONT.copy(), start.copy(), 0.0, False
    for _ in range(2500):
        q = q + 0.5 * h * dq
        T = oracle.frame(q, "panda_hand")
        out = centre - (T[:3, 3] + 0.03 * T[:3, 2])
        along = float(np.clip(out @ T[:3, 1], -0.075, 0.075))
        apart = out - along * T[:3, 1]
        distance = float(np.linalg.norm(apart))
        load, way = STIFFNESS * max(0.065 - distance, 0.0), -apart / distance
        J, arm_point = oracle.jacobian(q, "panda_hand"), centre + (0.03 + 0.5 * max(0.065 - distance, 0.0)) * way
        tau = J.T @ (load * np.concatenate([way, np.cross(arm_point - T[:3, 3], way)]))
        dq = dq + h * oracle.acceleration(q, dq, tau)
        q = q + 0.5 * h * dq
        impulse, touched = impulse + h * load, touched or load > 0.0
        if touched and load == 0.0:
            return impulse
    raise AssertionError("the hand did not leave the ball")


def arm(make_plant, panda_urdf, oracle, folder, rotor, speed, wall, phase):
    """Move the hand's capsule, which is parallel to y, along x into a fixed ball or the face of a box.

    Returns:
        reflected mass [kg] and errors.
    """
    n = np.array([1.0, 0.0, 0.0])
    T, J = oracle.frame(FRONT, "panda_hand"), oracle.jacobian(FRONT, "panda_hand")
    # The hand's capsule: 0.035 m thick, its axis along y of the hand, 0.03 m before the hand's frame.
    touch = T[:3, 3] + 0.03 * T[:3, 2] + 0.035 * n
    row = n @ J[:3] + np.cross(touch - T[:3, 3], n) @ J[3:]
    inverse = np.linalg.inv(oracle.mass_matrix(FRONT) + rotor * np.eye(7))
    mass = 1.0 / (row @ inverse @ row)
    gap = (1.0 + phase) * STEP * speed
    shape = {"sphere": {"shape": "sphere", "size": 0.03}, "box": {"shape": "box", "size": [0.1, 0.5, 0.03]}}[wall]
    reach = {"sphere": 0.03, "box": 0.05}[wall]
    item = {
        "name": "wall",
        **shape,
        "pose": {"xyz": (touch + (reach + gap) * n).tolist()},
        "contact": "penalty",
        "friction": 0.0,
    }
    plant = make_plant(panda_urdf, world=write_world(folder, item), rotor_inertia=rotor, gravity=[0.0, 0.0, 0.0])
    start = mass * speed * inverse @ row
    plant.reset(FRONT, start)
    peak, impulse = collide(plant, 8 + math.ceil(math.pi * math.sqrt(mass / STIFFNESS) / STEP))
    assert plant.contacts() == []
    q, dq = map(np.array, plant.engine_state())
    plant.close()
    after, before = (v @ (oracle.mass_matrix(x) + rotor * np.eye(7)) @ v for x, v in ((q, dq), (FRONT, start)))
    given = 2.0 * mass * speed if wall == "box" else impulse_on_ball(panda_urdf, rotor, start, touch + (0.03 + gap) * n)
    expected = (speed * math.sqrt(mass * STIFFNESS), given, before)
    return mass, Errors(*(100.0 * (x / y - 1.0) for x, y in zip((peak, impulse, after), expected, strict=True)))


@pytest.mark.parametrize("shape", list(SIZES))
def test_a_free_body_gives_the_peak_the_impulse_and_the_energy_of_the_formula(
    make_plant, panda_urdf, plant_type, tmp_path, table, shape
):
    for mass, speed in itertools.product(MASSES, SPEEDS):
        errors = worst(
            [free_body(make_plant, panda_urdf, tmp_path, shape, mass, speed, phase) for phase in (0.0, 0.55)]
        )
        note(table, plant_type, f"free {shape}", 0.0, mass, speed, errors, POINT if shape == "sphere" else FACE)


@pytest.mark.parametrize("wall", ["sphere", "box"])
@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_the_hand_gives_those_of_its_effective_mass(make_plant, panda_urdf, plant_type, tmp_path, table, rotor, wall):
    oracle = Oracle(panda_urdf)
    for speed in SPEEDS:
        rows = [arm(make_plant, panda_urdf, oracle, tmp_path, rotor, speed, wall, phase) for phase in (0.0, 0.55)]
        errors = worst([row[1] for row in rows])
        note(
            table,
            plant_type,
            f"hand on a {wall}",
            rotor,
            rows[0][0],
            speed,
            errors,
            POINT if wall == "sphere" else FACE,
        )


@pytest.mark.slow
@pytest.mark.parametrize("shape", list(SIZES))
def test_it_does_so_at_every_phase_of_the_step(make_plant, panda_urdf, plant_type, tmp_path, table, shape):
    for mass, speed in itertools.product((0.6, 1.0, 2.0, 5.0), (0.25, 0.5, 1.0)):
        errors = worst([free_body(make_plant, panda_urdf, tmp_path, shape, mass, speed, k / 10) for k in range(10)])
        note(
            table,
            plant_type,
            f"free {shape}, 10 phases",
            0.0,
            mass,
            speed,
            errors,
            POINT if shape == "sphere" else FACE,
        )


@pytest.mark.slow
@pytest.mark.parametrize("wall", ["sphere", "box"])
@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_the_hand_does_so_at_every_phase_of_the_step(make_plant, panda_urdf, plant_type, tmp_path, table, rotor, wall):
    oracle = Oracle(panda_urdf)
    for speed in (0.25, 0.5, 1.0):
        rows = [arm(make_plant, panda_urdf, oracle, tmp_path, rotor, speed, wall, k / 10) for k in range(10)]
        errors = worst([row[1] for row in rows])
        note(
            table,
            plant_type,
            f"hand on a {wall}, 10 phases",
            rotor,
            rows[0][0],
            speed,
            errors,
            POINT if wall == "sphere" else FACE,
        )
