"""Fixtures of the contract tests, each of which runs on every RobotHW backend."""

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
    """Emulated control boxes for one test file, since each uses a sixth of a processor even at rest."""
    made = Boxes()
    yield made
    made.close()


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def connect(backend: str, boxes: Boxes) -> Iterator[Callable[..., Robot]]:
    """Return a function connect(**parameters) that returns a Robot, which is closed after the test."""
    with ExitStack() as stack:

        def make(**parameters: Any) -> Robot:
            return stack.enter_context(connected(backend, boxes, **parameters))

        yield make


@pytest.fixture
def robot(connect: Callable[..., Robot]) -> Robot:
    """Robot with its default parameters."""
    return connect()
