"""Robots for the tests, and the folder of the helpers."""

import sys
from pathlib import Path

import numpy as np
import pytest

import panda_description

sys.path.insert(0, str(Path(__file__).parent))

from rigid_body_oracle import wide

from pybullet_ros_control.plant import PyBulletPlant

PANDA = [f"panda_joint{i}" for i in range(1, 8)]


@pytest.fixture(scope="session")
def panda_urdf():
    return panda_description.load(meshes=False)


@pytest.fixture(scope="session")
def wide_panda_urdf(panda_urdf):
    return wide(panda_urdf)


@pytest.fixture
def make_plant():
    plants = []

    def make(urdf, joints=PANDA, q=None, **config):
        plant = PyBulletPlant(urdf, joints, config)
        plants.append(plant)
        if q is not None:
            plant.reset(q)
        return plant

    yield make
    for plant in plants:
        plant.close()


@pytest.fixture
def rng():
    return np.random.default_rng(0)
