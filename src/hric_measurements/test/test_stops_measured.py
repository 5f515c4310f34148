"""Stops of the emulated arm compared with an independent integration of the same stop, and the command."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import yaml
from scipy.integrate import solve_ivp

from hric_assessment.separation import stopping
from hric_assessment.separation.stopping import NOT_A_BRAKE, SIMULATION
from hric_core.command import main, perform
from hric_core.errors import HricError
from hric_measurements.stops.measuring import LOAD_RADIUS, POSES, STANDSTILL, StoppedArm, StopStart, standing
from hric_run.definition import experiment
from hric_run.simulation import Simulation

DECELERATION = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])
"""Franka's limits of a Panda's joint acceleration [rad/s^2] (its documentation of the control interface)."""
EFFORT = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
"""Franka's torque limits of a Panda's joints [N m]."""
TOLERANCE = 0.02


@pytest.fixture(scope="module", params=["mujoco", "pybullet"])
def simulation(request: pytest.FixtureRequest) -> Iterator[Simulation]:
    with Simulation(experiment.load(experiment.NONE, [f"simulator:={request.param}"])) as made:
        yield made


def integrated(simulation: Simulation, begun: StopStart, mass: float) -> tuple[float, float]:
    """(time [s], distance [m]) of the stop, in continuous time: forward dynamics of pinocchio and an integrator
    with step control, under the deceleration law of the box in closed form."""
    model = pinocchio.buildModelFromXML(simulation.tree["robot_description"])
    fingers = [model.getJointId(name) for name in model.names if "finger" in name]
    model = pinocchio.buildReducedModel(model, fingers, pinocchio.neutral(model))
    model.armature[:] = simulation.app.hw.rotor_inertia
    tcp = model.getFrameId("panda_hand_tcp")
    ball = pinocchio.Inertia(mass, np.zeros(3), 0.4 * mass * LOAD_RADIUS**2 * np.eye(3))
    model.inertias[7] += model.frames[tcp].placement.act(ball)
    data, law = model.createData(), simulation.app.hw.box.joint_impedance
    K, D, a = np.array(law.stiffness), np.array(law.damping), DECELERATION
    sense, fast = np.sign(begun.dq), np.abs(begun.dq)

    def motion(t: float, x: np.ndarray) -> np.ndarray:
        q, dq = x[:7], x[7:14]
        braked = np.minimum(t, fast / a)
        q_d = begun.q + sense * (fast * braked - 0.5 * a * braked**2)
        dq_d = sense * (fast - a * braked)
        tau = np.clip(K * (q_d - q) + D * (dq_d - dq), -EFFORT, EFFORT)
        gravity = pinocchio.computeGeneralizedGravity(model, data, q)
        return np.concatenate([dq, pinocchio.aba(model, data, q, dq, tau + gravity), [speed(x)]])

    def speed(x: np.ndarray) -> float:
        J = pinocchio.computeFrameJacobian(model, data, x[:7], tcp, pinocchio.LOCAL_WORLD_ALIGNED)
        return float(np.linalg.norm(J[:3] @ x[7:14]))

    def stands(t: float, x: np.ndarray) -> float:
        return speed(x) - STANDSTILL

    start = np.concatenate([begun.q, begun.dq, [0.0]])
    found = solve_ivp(motion, (0.0, 1.5), start, method="LSODA", rtol=1e-7, atol=1e-9, events=stands)
    return float(found.t_events[0][-1]), float(found.y_events[0][-1][14])


@pytest.mark.parametrize("mass", [0.0, 3.0])
@pytest.mark.parametrize(("pose", "number"), [(0, 0), (0, 6), (1, 2)])
@pytest.mark.parametrize("speed", [0.25, 1.0])
def test_time_and_distance_agree_with_an_independent_integration_of_the_same_stop(
    simulation: Simulation, mass: float, pose: int, number: int, speed: float
) -> None:
    arm = StoppedArm(simulation.app.hw)
    arm.carry(mass)
    begun = list(arm.begins(np.array(POSES[pose]), speed, [np.inf] * 7))[number]
    stopped, (time, distance) = arm.stop(begun), integrated(simulation, begun, mass)
    print(f"{stopped.time:.4f} {time:.4f} s, {stopped.distance:.5f} {distance:.5f} m")
    assert stopped.time == pytest.approx(time, rel=TOLERANCE)
    assert stopped.distance == pytest.approx(distance, rel=TOLERANCE)


def test_a_motion_begins_at_the_speed_that_was_asked_for_within_the_joints_limits(simulation: Simulation) -> None:
    arm, limit = StoppedArm(simulation.app.hw), simulation.app.hw.box.config.limits.velocity
    begun = list(arm.begins(np.array(POSES[0]), 0.5, limit))
    assert len(begun) > 6
    for one in begun:
        assert np.linalg.norm(arm.jacobian(one.q) @ one.dq) == pytest.approx(0.5)
        assert np.all(np.abs(one.dq) <= limit)
    assert not list(arm.begins(np.array(POSES[0]), 50.0, limit))


def test_the_end_of_a_stop_is_found_between_two_samples() -> None:
    """Time and distance of a stop with constant deceleration are known exactly."""
    v, a, dt = 0.8, 4.0, 1e-3
    speed = np.maximum(v - a * dt * np.arange(400), 0.0)
    stopped = standing(speed, dt)
    assert stopped.time == pytest.approx((v - STANDSTILL) / a, rel=1e-9)
    assert stopped.distance == pytest.approx((v**2 - STANDSTILL**2) / (2.0 * a), rel=1e-9)


def test_the_command_prints_a_table_that_loads_and_says_what_it_is_not(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    words = ["measure_stops", "--speeds", "0.5", "--loads", "0", "1"]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert NOT_A_BRAKE in printed
    path = tmp_path / "stops.yaml"
    assert main([*words, "-o", str(path)]) == 0
    said = capsys.readouterr().out
    assert NOT_A_BRAKE in said and str(path) in said
    table = stopping.load(path)
    assert table.kind == SIMULATION and [(row.speed, row.load) for row in table.stops] == [(0.5, 0.0), (0.5, 1.0)]
    printed_rows = yaml.safe_load(printed)["stops"]
    shipped = {(row.speed, row.load): row for row in stopping.load().stops}
    for row in table.stops:
        assert row.time == pytest.approx(shipped[row.speed, row.load].time, rel=1e-4)
        assert row.distance == pytest.approx(shipped[row.speed, row.load].distance, rel=1e-4)
    assert printed_rows == yaml.safe_load(path.read_text())["stops"]  # the same each time


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--speeds", "-1"], "--speeds"),
        (["--speeds", "nan"], "--speeds"),
        (["--loads", "-1"], "--loads"),
        (["--speeds", "40"], "no pose reaches 40 m/s"),
        (["simulator:=unity"], "unity"),
        (["simulater:=mujoco"], "simulater"),
    ],
)
def test_mistakes_get_one_error(words: list[str], said: str) -> None:
    with pytest.raises(HricError, match=said):
        perform(["measure_stops", *words])
