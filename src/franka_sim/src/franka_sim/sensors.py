"""Sensors of the simulated arm: joint state of the plant plus noise, the only state that the control box reads."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from franka_sim.box.control_box import ControlBox
from franka_sim.realism import JOINTS, Realism
from hric_control.plant import Plant
from hric_core.native.vectors import add

ReadState = Callable[[list[float], list[float], list[float]], None]
"""Function that writes the joint state into three lists: q [rad], dq [rad/s], tau [N m], like `Plant.read_state`."""
Row = tuple[list[float], list[float], list[float], list[float]]
BLOCK = 32
"""Number of cycles whose noise is drawn at once: a compromise between many small draws and one slow cycle."""
CUT_OFF = 5.0
"""Bound at which the noise is clipped [standard deviations]."""


def _noise(rng: np.random.Generator, scale: npt.NDArray[np.float64]) -> Iterator[Row]:
    """Yield the noise of q, dq, tau_J and the wrench for each cycle; scale: standard deviations, shape (27,)."""
    while True:
        noise = rng.standard_normal((BLOCK, len(scale)))
        np.clip(noise, -CUT_OFF, CUT_OFF, out=noise)
        noise *= scale
        parts = np.split(noise, (JOINTS, 2 * JOINTS, 3 * JOINTS), axis=1)
        yield from zip(*(part.tolist() for part in parts), strict=True)


class Sensors:
    """Sensors that add noise to the plant's joint state.

    Args:
        plant: physics engine.
        realism: standard deviations of the noise.
        seed: random seed of the run.

    Attributes:
        wrench: noise of the external wrench in this cycle, 3 forces [N] and 3 moments [N m]; always the same list.
    """

    def __init__(self, plant: Plant, realism: Realism, seed: int) -> None:
        self._read = plant.read_state
        scale = np.array([*realism.q_noise, *realism.dq_noise, *realism.tau_J_noise, *realism.wrench_noise])
        self._rows = _noise(np.random.default_rng(seed), scale)
        self.wrench = [0.0] * 6

    def read(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Read the plant like `Plant.read_state`; each call draws new noise, so call it once per cycle."""
        self._read(q, dq, tau)
        q_noise, dq_noise, tau_noise, wrench_noise = next(self._rows)
        q[:], dq[:], tau[:] = add(q, q_noise), add(dq, dq_noise), add(tau, tau_noise)
        self.wrench[:] = wrench_noise


def attach(plant: Plant, box: ControlBox, realism: Realism, seed: Any) -> ReadState:
    """Return the function with which the control box reads the joint state; without noise it is `plant.read_state`.

    Args:
        plant: physics engine.
        box: control box; the noise of its external wrench estimate is connected here.
        realism: standard deviations of the noise.
        seed: random seed of the run.
    """
    if not realism.noisy:
        return plant.read_state
    sensors = Sensors(plant, realism, seed)
    box.take_wrench_noise(sensors.wrench, CUT_OFF * math.hypot(*realism.wrench_noise))
    return sensors.read
