"""Measurements of how an engine simulates a robot description, compared with pinocchio."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from conformance_oracle import FloatArray, Oracle, ends
from conformance_robots import without_losses

from hric_control.plant import Plant
from hric_control.plants import DivergedError
from hric_core import plugins

ENGINES = {
    "PyBullet": "pybullet_ros_control/PyBulletPlant",
    "MuJoCo": "mujoco_ros_control/MujocoPlant",
    "OpenSim": "opensim_ros_control/OpenSimPlant",
}
INSTANT = 1e-6
"""Time step to compute accelerations from the change of velocity [s].

It is shorter than the time constants of all joint laws, and long enough for a change with ten significant digits.
"""
ROUND = 1e-3
"""Overlap of mesh corners up to which PyBullet, which rounds them, may report no contact [m]."""
TOUCHING = 1e-6
"""Overlap below which shapes only touch each other, so that engines may differ in reporting a contact [m]."""

Pair = tuple[str, str]


@contextmanager
def loaded(engine: str, urdf: str, joints: list[str], **config: Any) -> Iterator[Plant]:
    """Yield a plant, closed at the end; by default without rotor inertia, and on OpenSim without effort limits."""
    limits = {"effort_limits": False} if engine == "OpenSim" else {}
    plant = plugins.find(plugins.PLANT, ENGINES[engine])(urdf, joints, {"rotor_inertia": 0.0, **limits, **config})
    try:
        yield plant
    finally:
        plant.close()


def held(oracle: Oracle) -> bool:
    """Return True if a joint has equal limits: its stops hold it, which pinocchio does not model."""
    return any(high <= low for low, high in ends([oracle.elements[name] for name in oracle.independent]))


def random_states(oracle: Oracle, count: int, seed: int) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield random positions, velocities and efforts of the independent joints.

    Positions are within the joint ranges; efforts cause accelerations of about 10 rad/s^2.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array(ends([oracle.elements[name] for name in oracle.independent])).T
    for _ in range(count):
        z, dz = (low + (high - low) * rng.uniform(0.2, 0.8, len(low)), rng.uniform(-1.0, 1.0, len(low)))
        acceleration = rng.uniform(-10.0, 10.0, len(low)) - oracle.acceleration(z, dz, np.zeros(len(low)))
        yield z, dz, oracle.mass_matrix(z) @ acceleration


def acceleration_error(engine: str, urdf: str, states: int, seed: int = 0) -> float:
    """Return the largest acceleration difference from pinocchio, relative to the largest acceleration of a state."""
    urdf = without_losses(urdf)
    oracle, worst = Oracle(urdf), 0.0
    n = len(oracle.independent)
    with loaded(engine, urdf, oracle.independent, collision=False, time_step=INSTANT) as plant:
        q, dq, tau = [0.0] * n, [0.0] * n, [0.0] * n
        for z, dz, efforts in random_states(oracle, states, seed):
            plant.reset(z.tolist(), dz.tolist())
            plant.apply(efforts.tolist())
            plant.step()
            plant.read_state(q, dq, tau)
            expected = oracle.step(z, dz, efforts, INSTANT)[1] - dz
            worst = max(worst, np.abs(np.array(dq) - dz - expected).max() / np.abs(expected).max())
    return worst


def law_error(plant: Plant, oracle: Oracle) -> float:
    """Return the largest deviation of a joint from its mimic law [rad or m]."""
    z, worst = np.array(plant.engine_state()[0]), 0.0
    for element in oracle.elements.values():
        child = element.find("child")
        assert child is not None
        link = child.get("link", "")
        T, expected = plant.link_state(link)[0], oracle.pose(z, link)
        worst = max(worst, float(np.abs(T - expected).max()))
    return worst


def motion_error(engine: str, urdf: str, steps: int, **config: Any) -> float:
    """Return the largest deviation from the mimic laws, at rest and during a motion by gravity and constant efforts."""
    oracle = Oracle(urdf)
    (z, _, efforts), *_ = random_states(oracle, 1, seed=1)
    with loaded(engine, urdf, oracle.independent, collision=False, **config) as plant:
        plant.reset(z.tolist())
        worst = law_error(plant, oracle)
        for k in range(steps):
            plant.apply(efforts.tolist() if k < steps // 2 else [0.0] * len(efforts))
            plant.step()
            worst = max(worst, law_error(plant, oracle))
    return worst


def contacts_at_rest(engine: str, urdf: str) -> dict[Pair, float]:
    """Return the overlap of each pair of links in contact, with all joints at zero or the nearest limit [m]."""
    oracle = Oracle(urdf)
    rest = [min(max(0.0, low), high) for low, high in ends([oracle.elements[name] for name in oracle.independent])]
    found: dict[Pair, float] = {}
    with loaded(engine, urdf, oracle.independent, gravity=[0.0, 0.0, 0.0], collision_masks="") as plant:
        plant.set_brakes([True] * len(rest))
        plant.reset(rest)
        plant.apply([0.0] * len(rest))
        with suppress(
            DivergedError
        ):  # deep overlaps may accelerate free links strongly; they are reported all the same
            plant.step()
        for contact in plant.contacts():
            a, b = sorted(name.partition("::")[2] for name in (contact.body_a, contact.body_b))
            found[a, b] = max(found.get((a, b), 0.0), contact.depth)
    return found


def overlapping(contacts: dict[Pair, float], by: float = TOUCHING) -> set[Pair]:
    """Return the pairs that overlap by more than a distance [m]."""
    return {pair for pair, depth in contacts.items() if depth > by}
