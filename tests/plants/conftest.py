"""Fixtures of the plant tests, each of which runs on every engine."""

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
import pytest

import panda_description
from hric_control.plant import Plant
from hric_core import plugins

PANDA = [f"panda_joint{i}" for i in range(1, 8)]


class MakePlant(Protocol):
    """Type of make_plant(urdf, joints, q, **parameters), which returns a plant at q, closed after the test."""

    def __call__(
        self, urdf: str, joints: Sequence[str] = PANDA, q: Sequence[float] | None = None, **config: Any
    ) -> Plant: ...


@pytest.fixture(params=list(plugins.names(plugins.PLANT)), ids=lambda name: name.rpartition("/")[2])
def plant_type(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def make_plant(plant_type: str) -> Iterator[MakePlant]:
    plants: list[Plant] = []

    def make(urdf: str, joints: Sequence[str] = PANDA, q: Sequence[float] | None = None, **config: Any) -> Plant:
        plant = plugins.find(plugins.PLANT, plant_type)(urdf, joints, config)
        plants.append(plant)
        if q is not None:
            plant.reset(q)
        return plant

    yield make
    for plant in plants:
        plant.close()


@pytest.fixture(scope="session")
def panda_urdf() -> str:
    return panda_description.load(meshes=False)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)
