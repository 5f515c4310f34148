"""Robots for the tests."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from rigid_body_oracle import wide

import panda_description
from mujoco_ros_control.plant import MujocoPlant

PANDA = [f"panda_joint{i}" for i in range(1, 8)]


@pytest.fixture(scope="session")
def panda_urdf() -> str:
    return panda_description.load(meshes=False)


@pytest.fixture(scope="session")
def wide_panda_urdf(panda_urdf: str) -> str:
    return wide(panda_urdf)


@pytest.fixture
def make_plant() -> Iterator[Callable[..., MujocoPlant]]:
    def make(urdf: str, joints: list[str] = PANDA, q: list[float] | None = None, **config: Any) -> MujocoPlant:
        plant = MujocoPlant(urdf, joints, config)
        if q is not None:
            plant.reset(q)
        return plant

    yield make


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)
