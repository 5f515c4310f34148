"""Computing time of the control box, relative to a bare step of the engine measured in the same rounds."""

from collections.abc import Callable
from statistics import median

import pybullet
import pytest
from cost_ratio import cost_ratio, seconds

import panda_description
from franka_sim.realism import parse
from franka_sim.sensors import attach

pytestmark = pytest.mark.alone


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, panda_description.friction_parameters()], ids=["frictionless", "friction"])
def test_read_and_write_in_torque_control_cost_few_bare_steps(
    make_box, torques, friction, figure: Callable[..., None]
) -> None:
    arm = make_box(config={"friction": friction}, plant={"rotor_inertia": 0.0})
    box, client = arm.box, arm.plant._engine.client
    box.set_collision_behavior(*[[1e3] * 7] * 4, *[[1e4] * 6] * 4)
    arm.start()
    command, q, tau = torques(*[0.1] * 7), arm.state.q[:], arm.state.tau_J[:]
    dq = [0.1, -0.1, 0.1, -0.1, 0.1, -0.1, 0.1]

    def cycle() -> None:
        box.read(q, dq, tau, 0.0)
        box.write(command)

    ratio = cost_ratio(cycle, lambda: pybullet.stepSimulation(client), times=50)
    figure(f"control box, {'friction' if friction else 'frictionless'}: read and write beside a bare step", ratio, "1")
    assert ratio < 8.0


@pytest.mark.slow
def test_sensors_with_noise_cost_less_than_half_a_bare_step_more_than_the_plants_own_reading(
    make_box, figure: Callable[..., None]
) -> None:
    arm = make_box(plant={"rotor_inertia": 0.0})
    client, row = arm.plant._engine.client, ([0.0] * 7, [0.0] * 7, [0.0] * 7)
    noisy = attach(arm.plant, arm.box, parse("measured", ""), 0)
    works = lambda: noisy(*row), lambda: arm.plant.read_state(*row), lambda: pybullet.stepSimulation(client)
    rounds = [[seconds(work, 64) for work in works] for _ in range(101)]
    more = median((with_noise - without) / bare for with_noise, without, bare in rounds)
    figure("sensors with noise: reading takes more by, in bare steps", more, "1")
    assert more < 0.5
