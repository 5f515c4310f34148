"""A simulated arm without a master, and what tests do with it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import panda_description
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_control.hardware_interface import EffortJointInterface
from hric_control.local_node import LocalNode
from hric_control.robot_hw import ControllerInfo

# No shapes: these tests are about the arm, and cost half of the time without them.
PLANT = {"collision": False, "self_collision": False}


@functools.cache
def description(**arguments: Any) -> str:
    return panda_description.load(meshes=False, collision=False, **arguments)


def claim(interface: type = EffortJointInterface, name: str = "law", joints: int = 7, arm_id: str = "panda") -> ControllerInfo:
    """A controller that claims the first joints of the arm through an interface."""
    return ControllerInfo(name, "test/Law", {interface.cpp_name: frozenset(f"{arm_id}_joint{i}" for i in range(1, joints + 1))})


class Arm:
    """A FrankaHWSim and its node; `run` drives it for a while with a law."""

    def __init__(self, urdf: dict[str, Any], plant: dict[str, Any], parameters: dict[str, Any]) -> None:
        given = {"robot_description": description(**urdf), "real_time_factor": 0.0, "plant": {**PLANT, **plant}, **parameters}
        self.node = LocalNode(given)
        self.hw = FrankaHWSim()
        self.hw.init(self.node, self.node)
        self._open = True

    def close(self) -> None:
        if self._open:
            self._open = False
            self.hw.shutdown()

    def run(self, duration: float, law: Callable[[float], None] | None = None) -> None:
        end = self.hw.loop.time + duration

        def on_cycle(time: float, period: float, reset_controllers: bool) -> bool:
            if law is not None:
                law(time)
            if time + 1.5 * period > end:
                self.hw.stop()
            return True

        self.hw.run(on_cycle)


@pytest.fixture
def make_arm() -> Iterator[Callable[..., Arm]]:
    """make_arm(hand=True, ..., plant={...}, parameters={...}) -> Arm; the other arguments are those of the description."""
    made: list[Arm] = []

    def make(plant: dict[str, Any] | None = None, parameters: dict[str, Any] | None = None, **urdf: Any) -> Arm:
        made.append(Arm(urdf, plant or {}, parameters or {}))
        return made[-1]

    yield make
    for arm in made:
        arm.close()


@pytest.fixture(name="claim")
def claim_fixture() -> Callable[..., ControllerInfo]:
    return claim
