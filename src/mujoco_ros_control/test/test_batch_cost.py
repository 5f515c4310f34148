"""Throughput of a batch of runs, relative to the same runs one by one in the same rounds."""

from collections.abc import Callable, Iterator
from statistics import median
from time import perf_counter, process_time

import numpy as np
import pytest

from hric_control.plant import FloatArray, Load
from mujoco_ros_control.batch import MujocoBatch
from mujoco_ros_control.plant import MujocoPlant

pytestmark = [pytest.mark.slow, pytest.mark.alone]
PANDA = [f"panda_joint{i}" for i in range(1, 8)]
READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
STIFFNESS, DAMPING = np.array([200.0] * 4 + [50.0] * 3), np.array([20.0] * 4 + [5.0] * 3)
STEPS, ROUNDS = 100, 5


def law(t: float, q: FloatArray, dq: FloatArray) -> FloatArray:
    return STIFFNESS * (READY - q) - DAMPING * dq


def one_by_one(plant: MujocoPlant, runs: int) -> None:
    q, dq, tau = ([0.0] * 7 for _ in range(3))
    for _ in range(runs):
        plant.set_configuration(READY.tolist())
        for k in range(STEPS):
            plant.read_state(q, dq, tau)
            plant.apply(law(k * plant.time_step, np.array(q), np.array(dq)))
            plant.step()


def times(work: Callable[[], object]) -> tuple[float, float]:
    """Return the time and the processor time of all threads that a function takes [s]."""
    wall, processor = perf_counter(), process_time()
    work()
    return perf_counter() - wall, process_time() - processor


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("runs", [1, 16, 64, 256])
@pytest.mark.parametrize("collision", [True, False])
@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
def test_a_large_batch_without_collision_takes_less_processor_time_than_single_runs(
    panda_urdf: str, integrator: str, collision: bool, runs: int, threads: int, figure: Callable[..., None]
) -> None:
    plant = MujocoPlant(panda_urdf, PANDA, {"integrator": integrator, "collision": collision})
    plant.set_configuration(READY.tolist())

    def loaded() -> Iterator[MujocoPlant]:
        for run in range(runs):
            plant.set_load(Load(0.01 * (1 + run)))
            yield plant

    batch = MujocoBatch(loaded(), threads)
    pairs = [(times(lambda: one_by_one(plant, runs)), times(lambda: batch.run(law, STEPS))) for _ in range(ROUNDS)]
    case = f"{integrator}, {collision=}, {threads} threads, {runs} runs: one by one to a batch"
    wall, processor = (median(single[i] / many[i] for single, many in pairs) for i in range(2))
    figure(f"{case}, time", wall, "1")
    figure(f"{case}, processor time", processor, "1")
    assert collision or runs < 64 or threads > 1 or processor > 1.0
