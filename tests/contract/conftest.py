"""Each test of the contract runs on each back end."""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contract_robots import BACKENDS, Boxes, connected
from driven_robot import Robot


@pytest.fixture(scope="module")
def boxes() -> Iterator[Boxes]:
    """Of one file only: even at rest each takes a sixth of a processor."""
    made = Boxes()
    yield made
    made.close()


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def connect(backend: str, boxes: Boxes) -> Iterator[Callable[..., Robot]]:
    """connect(**parameters) -> Robot, closed with the test."""
    with ExitStack() as stack:

        def make(**parameters: Any) -> Robot:
            return stack.enter_context(connected(backend, boxes, **parameters))

        yield make


@pytest.fixture
def robot(connect: Callable[..., Robot]) -> Robot:
    """With its usual parameters."""
    return connect()
