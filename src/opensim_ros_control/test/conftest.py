"""Robots in OpenSim for the tests."""

import re

import numpy as np
import pytest

import panda_description
from opensim_ros_control.plant import OpenSimPlant

PANDA = [f"panda_joint{i}" for i in range(1, 8)]


def without_stops(urdf):
    return re.sub(r'lower="[^"]*" upper="[^"]*"', 'lower="-1000" upper="1000"', urdf)


@pytest.fixture(scope="session")
def panda_urdf():
    return panda_description.load(meshes=False, collision=False)


@pytest.fixture(scope="session")
def wide_panda_urdf(panda_urdf):
    return without_stops(panda_urdf)


@pytest.fixture(scope="session")
def contact_urdf():
    return panda_description.load(meshes=False)


@pytest.fixture
def make_plant():
    """Provide a function that makes plants, by default with the Panda's joints and without friction, at q."""

    def make(urdf, joints=PANDA, q=None, **config):
        plant = OpenSimPlant(urdf, joints, config)
        if q is not None:
            plant.reset(q)
        return plant

    return make


@pytest.fixture
def rng():
    return np.random.default_rng(0)
