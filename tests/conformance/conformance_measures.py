"""What an engine makes of a description, beside pinocchio."""

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
"""Step whose change of speed is the acceleration at a state [s]: shorter than the time constant of any law, long enough
that the change has ten digits."""
ROUND = 1e-3
"""PyBullet rounds the corners of meshes: two of them may overlap by so much before they touch there [m]."""
TOUCHING = 1e-6
"""Overlap below which shapes lie on each other, which engines may call contact or not [m]."""

Pair = tuple[str, str]


@contextmanager
def loaded(engine: str, urdf: str, joints: list[str], **config: Any) -> Iterator[Plant]:
    """A plant, closed at the end; without rotors, and OpenSim without limits of efforts, if not said otherwise."""
    limits = {"effort_limits": False} if engine == "OpenSim" else {}
    plant = plugins.find(plugins.PLANT, ENGINES[engine])(urdf, joints, {"rotor_inertia": 0.0, **limits, **config})
    try:
        yield plant
    finally:
        plant.close()


def held(oracle: Oracle) -> bool:
    """Whether a joint has a range of no width: its stops hold it, of which pinocchio knows nothing."""
    return any(high <= low for low, high in ends([oracle.elements[name] for name in oracle.independent]))


def random_states(oracle: Oracle, count: int, seed: int) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Positions within the ranges, speeds, and efforts that cause accelerations of some 10 rad/s^2, of the independent
    joints."""
    rng = np.random.default_rng(seed)
    low, high = np.array(ends([oracle.elements[name] for name in oracle.independent])).T
    for _ in range(count):
        z, dz = (low + (high - low) * rng.uniform(0.2, 0.8, len(low)), rng.uniform(-1.0, 1.0, len(low)))
        acceleration = rng.uniform(-10.0, 10.0, len(low)) - oracle.acceleration(z, dz, np.zeros(len(low)))
        yield z, dz, oracle.mass_matrix(z) @ acceleration


def acceleration_error(engine: str, urdf: str, states: int, seed: int = 0) -> float:
    """Largest difference of one-step accelerations to pinocchio, relative to the largest acceleration of the state."""
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
    """Largest distance of a link from where the independent joints have it, by the laws of the others [rad or m]."""
    z, worst = np.array(plant.engine_state()[0]), 0.0
    for element in oracle.elements.values():
        child = element.find("child")
        assert child is not None
        link = child.get("link", "")
        T, expected = plant.link_state(link)[0], oracle.pose(z, link)
        worst = max(worst, float(np.abs(T - expected).max()))
    return worst


def motion_error(engine: str, urdf: str, steps: int, **config: Any) -> float:
    """Largest distance from the laws at the start and over a motion from rest by gravity and constant efforts."""
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
    """Overlap [m] of each pair of the robot's links that touch where all joints are at zero, or as near as they get."""
    oracle = Oracle(urdf)
    rest = [min(max(0.0, low), high) for low, high in ends([oracle.elements[name] for name in oracle.independent])]
    found: dict[Pair, float] = {}
    with loaded(engine, urdf, oracle.independent, gravity=[0.0, 0.0, 0.0], collision_masks="") as plant:
        plant.set_brakes([True] * len(rest))
        plant.reset(rest)
        plant.apply([0.0] * len(rest))
        with suppress(DivergedError):  # deep overlaps may throw what they find loose; they are found all the same
            plant.step()
        for contact in plant.contacts():
            a, b = sorted(name.partition("::")[2] for name in (contact.body_a, contact.body_b))
            found[a, b] = max(found.get((a, b), 0.0), contact.depth)
    return found


def overlapping(contacts: dict[Pair, float], by: float = TOUCHING) -> set[Pair]:
    """Pairs that overlap by more than that [m]."""
    return {pair for pair, depth in contacts.items() if depth > by}
