"""Simulation of published collisions of arms, with the shipped default of the emulated arm."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.mass import moving_masses
from hric_assessment.contact.speed import half_mass, permitted_speed
from hric_core import urdf
from hric_human.body.regions import REGION_MODELS
from hric_measurements.reproduction.definition import DataSet
from hric_measurements.speed_map import grid
from hric_measurements.speed_map.blow import ArmBehaviour, Blows
from hric_measurements.speed_map.device import HitBody
from hric_measurements.speed_map.grid import DIRECTIONS, Postures
from hric_measurements.speed_map.measured import limit_speed
from hric_run.definition import experiment
from hric_run.simulation import Simulation

HAND = "hand, fingers"
CLAMPED = 1e6
"""Mass of a measuring device that is fixed to a table [kg]."""
POINTS = ((0.3, 0.7, 3), (-0.3, 0.3, 3), (0.1, 0.5, 3))
"""Grid of contacts in the base frame: lowest and highest coordinate [m], number of points."""
SPEED = 0.25
"""Speed of the arm in the map of forces [m/s]."""


@contextmanager
def _robot() -> Iterator[FrankaHWSim]:
    with Simulation(experiment.load(experiment.NONE, ["simulator:=mujoco"])) as simulation:
        robot = simulation.app.hw
        assert isinstance(robot, FrankaHWSim), "the robot of an experiment without a robot section"
        yield robot


def downward_contacts(data: DataSet) -> dict[str, float]:
    """Return the relative range of peak forces in the workspace, and the highest limit speed by the standard's [1].

    The arm moves down on a clamped device with the stiffness of a hand; the standard's speed is that of M/2 + m_L.
    """
    stiffness = REGION_MODELS[HAND].stiffness
    limit = Limits.named().held_force((HAND,))
    body, down = HitBody(CLAMPED, stiffness), np.array(DIRECTIONS["-z"])
    with _robot() as robot:
        postures, blows = Postures(robot), Blows(robot, ArmBehaviour.DRIVEN)
        moving, tool = moving_masses(urdf.read(robot.description), robot.model.joint_names)
        standard = float(permitted_speed(limit, half_mass(moving - tool, tool), stiffness))
        forces, speeds = [], []
        for point in grid.points(*POINTS):
            if (q := postures.at(point)) is not None:
                approach = blows.approach(q, down)
                forces.append(blows.peak(approach, body, SPEED))
                speeds.append(limit_speed(partial(blows.peak, approach, body), limit, standard))
    return {"variation": max(forces) / min(forces) - 1.0, "limit": max(speeds) / standard}


def impacts(data: DataSet) -> dict[str, float]:
    """Return the mean peak force of simulated impacts at the speeds and joint positions of a data set [N].

    data: columns q1 to q7 [rad], nx, ny, nz (direction in the base frame), speed [m/s], stiffness [N/m], and force [N].
    """
    q = np.stack([data[f"q{k}"] for k in range(1, 8)], axis=1)
    directions = np.stack([data[name] for name in ("nx", "ny", "nz")], axis=1)
    with _robot() as robot:
        blows = Blows(robot, ArmBehaviour.DRIVEN)
        forces = [
            blows.peak(blows.approach(position, direction), HitBody(CLAMPED, float(stiffness)), float(speed))
            for position, direction, speed, stiffness in zip(
                q, directions, data["speed"], data["stiffness"], strict=True
            )
        ]
    return {"force": float(np.mean(forces))}
