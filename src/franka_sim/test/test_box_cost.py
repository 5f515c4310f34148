"""What the box costs, relative to a bare step of the engine measured in the same rounds."""

from __future__ import annotations

import time
from collections.abc import Callable

import pybullet
import pytest

import panda_description
from franka_sim.realism import parse
from franka_sim.sensors import attach


def least(work: Callable[[], object], n: int) -> float:
    begin = time.perf_counter()
    for _ in range(n):
        work()
    return (time.perf_counter() - begin) / n


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, panda_description.friction_parameters()], ids=["frictionless", "friction"])
def test_read_and_write_in_torque_control_cost_few_bare_steps(make_box, torques, friction, capsys) -> None:
    """Neighbours on the machine can only add to a round, so the least of many rounds counts."""
    arm = make_box(config={"friction": friction}, plant={"rotor_inertia": 0.0})
    box, client = arm.box, arm.plant._engine.client
    box.set_collision_behavior(*[[1e3] * 7] * 4, *[[1e4] * 6] * 4)
    arm.start()
    command, q, tau = torques(*[0.1] * 7), arm.state.q[:], arm.state.tau_J[:]
    dq = [0.1, -0.1, 0.1, -0.1, 0.1, -0.1, 0.1]

    def cycle() -> None:
        box.read(q, dq, tau, 0.0)
        box.write(command)

    rounds = [(least(cycle, 50), least(lambda: pybullet.stepSimulation(client), 50)) for _ in range(400)]
    ours, bare = (min(row) for row in zip(*rounds, strict=True))
    with capsys.disabled():
        print(f"\nread + write {1e6 * ours:.1f} us, bare step {1e6 * bare:.1f} us, ratio {ours / bare:.1f}")
    assert ours < 8.0 * bare


@pytest.mark.slow
def test_sensors_with_noise_cost_less_than_half_a_bare_step_more_than_the_plants_own_reading(make_box, capsys) -> None:
    arm = make_box(plant={"rotor_inertia": 0.0})
    client, row = arm.plant._engine.client, ([0.0] * 7, [0.0] * 7, [0.0] * 7)
    noisy = attach(arm.plant, arm.box, parse("measured", ""), 0)
    rounds = [
        (least(lambda: noisy(*row), 64), least(lambda: arm.plant.read_state(*row), 64), least(lambda: pybullet.stepSimulation(client), 64))
        for _ in range(400)
    ]
    with_noise, without, bare = (min(column) for column in zip(*rounds, strict=True))
    with capsys.disabled():
        print(f"\nreading with noise {1e6 * with_noise:.1f} us, without {1e6 * without:.1f} us, bare step {1e6 * bare:.1f} us")
    assert with_noise - without < 0.5 * bare
