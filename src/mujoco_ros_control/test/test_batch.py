"""Batches of runs: equality with single runs, and what a batch refuses."""

import re

import numpy as np
import pytest

import panda_description
from hric_control.plant import FloatArray, Load, Mode
from hric_core.errors import CommandError, FailureError
from mujoco_ros_control.batch import Law, MujocoBatch
from mujoco_ros_control.plant import MujocoPlant

PANDA = [f"panda_joint{i}" for i in range(1, 8)]
READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
STIFFNESS, DAMPING = np.array([200.0] * 4 + [50.0] * 3), np.array([20.0] * 4 + [5.0] * 3)
IDENTIFIED = {"friction": "identified", "friction_parameters": panda_description.friction_parameters()}
CASES = [
    {},
    {"integrator": "semi_implicit"},
    {"integrator": "semi_implicit", "half_step_readout": False, "time_step": 0.002},
    IDENTIFIED,
    {**IDENTIFIED, "integrator": "semi_implicit"},
    {"collision": False, "rotor_inertia": 0.0},
]


def hold(t: float, q: FloatArray, dq: FloatArray) -> FloatArray:
    return STIFFNESS * (READY + 0.1 * np.sin(5.0 * t) - q) - DAMPING * dq


def single(plant: MujocoPlant, law: Law, steps: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, dq and commanded efforts of one run on a plant, as in `Trajectories`, from its present state."""
    q, dq, tau = ([0.0] * 7 for _ in range(3))
    rows = []
    plant.read_state(q, dq, tau)
    for k in range(steps):
        command = law(k * plant.time_step, np.array([q]), np.array([dq]))[0]
        plant.apply(command)
        plant.step()
        plant.read_state(q, dq, tau)
        rows.append((list(q), list(dq), command))
    a, b, c = (np.array(part) for part in zip(*rows, strict=True))
    return a, b, c


def start(plant: MujocoPlant, run: int) -> MujocoPlant:
    """Prepare a plant for a run with its own payload, position and velocity."""
    draw = np.random.default_rng(run)
    plant.set_load(Load(draw.uniform(0.1, 3.0), (0.0, 0.0, 0.1)) if run else None, "panda_link7")
    plant.reset((READY + draw.uniform(-0.2, 0.2, 7)).tolist(), draw.uniform(-0.3, 0.3, 7).tolist())
    return plant


@pytest.mark.parametrize("config", CASES, ids=str)
@pytest.mark.parametrize("threads", [1, 3])
def test_each_run_of_a_batch_is_the_single_run_bit_for_bit(panda_urdf, config, threads):
    plant = MujocoPlant(panda_urdf, PANDA, config)
    batch = MujocoBatch((start(plant, run) for run in range(5)), threads)
    got = batch.run(hold, 300)
    again = batch.run(hold, 300)
    for run in range(5):
        expected = single(start(plant, run), hold, 300)
        for ours, repeated, theirs in zip(
            (got.q, got.dq, got.tau), (again.q, again.dq, again.tau), expected, strict=True
        ):
            assert ours[run].tobytes() == repeated[run].tobytes() == theirs.tobytes()
    assert np.ptp(got.q[:, -1], axis=0).max() > 1e-2  # five different runs
    assert got.time[-1] == pytest.approx(300 * plant.time_step)


def test_a_fixed_object_may_be_in_the_world(panda_urdf):
    plant = start(MujocoPlant(panda_urdf, PANDA, {}), 1)
    spawned(plant, fixed=True)
    batch = MujocoBatch([plant])
    assert batch.run(hold, 100).q[0].tobytes() == single(plant, hold, 100)[0].tobytes()


def test_joints_have_the_order_of_the_plant(panda_urdf):
    straight, reverse = (MujocoPlant(panda_urdf, names, {}) for names in (PANDA, PANDA[::-1]))
    start(straight, 1)
    start(reverse, 1).reset(straight.engine_state()[0][::-1], straight.engine_state()[1][::-1])
    a = MujocoBatch([straight]).run(hold, 100)
    b = MujocoBatch([reverse]).run(lambda t, q, dq: hold(t, q[:, ::-1], dq[:, ::-1])[:, ::-1], 100)
    assert a.q.tobytes() == b.q[:, :, ::-1].tobytes() and a.tau.tobytes() == b.tau[:, :, ::-1].tobytes()


def pushed(plant: MujocoPlant) -> None:
    plant.apply_wrench("panda_link7", [1.0, 0.0, 0.0], [0.0] * 3, [0.0] * 3, 1.0)


BALL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def spawned(plant: MujocoPlant, fixed: bool = False) -> None:
    T = np.eye(4)
    T[0, 3] = 2.0
    plant.spawn("ball", f'<robot name="ball"><link name="ball">{BALL}{BOX}</link></robot>', T, fixed=fixed)


def nothing(plant: MujocoPlant) -> None:
    pass


@pytest.mark.parametrize(
    "config, change, words",
    [
        ({}, pushed, "a wrench"),
        ({}, spawned, "models with joints or free objects"),
        ({}, lambda plant: plant.set_brakes([True] + [False] * 6), "braked or driven joints"),
        ({}, lambda plant: plant.set_modes([Mode.VELOCITY] * 7), "braked or driven joints"),
        ({}, lambda plant: plant.reset([0.0] * 7), "a joint that starts outside its range"),
        ({"friction": "identified", "friction_parameters": {"phi1": [0.0] * 7, "phi2": [1.0] * 7, "phi3": [0.0] * 7, "breakaway": [0.5] * 7}}, nothing, "static friction (breakaway)"),  # noqa: E501
    ],
)  # fmt: skip
def test_a_plant_that_a_batch_cannot_simulate_is_refused(panda_urdf, config, change, words):
    plant = start(MujocoPlant(panda_urdf, PANDA, config), 1)
    change(plant)
    with pytest.raises(CommandError, match=r"^run 0: its plant has .*" + re.escape(words)):
        MujocoBatch([plant])


def test_joints_without_transmission_and_coulomb_friction_are_refused(panda_urdf, wide_panda_urdf):
    with pytest.raises(CommandError, match="joints without transmission"):
        MujocoBatch([MujocoPlant(panda_urdf, PANDA[:6], {})])
    rough = re.sub(r"<dynamics[^>]*/>", "", wide_panda_urdf).replace("</joint>", '<dynamics friction="1"/></joint>')
    with pytest.raises(CommandError, match="Coulomb friction"):
        MujocoBatch([MujocoPlant(rough, PANDA, {"friction": "coulomb"})])


def test_wrong_arguments_are_refused(panda_urdf):
    plant = start(MujocoPlant(panda_urdf, PANDA, {}), 1)
    other = start(MujocoPlant(panda_urdf, PANDA, {"time_step": 0.002}), 1)
    batch = MujocoBatch([plant, plant])
    laws: list[tuple[Law, str]] = [
        (lambda t, q, dq: q[0], r"shape \(2, 7\) \(runs, joints\), as numbers; got \(7,\)"),
        (lambda t, q, dq: q + 1j, "elements of type complex128"),
        (lambda t, q, dq: q.astype(str), "elements of type <U"),
        (lambda t, q, dq: [[0.0] * 7, [0.0]], r"got \(\)"),
        (lambda t, q, dq: q * np.where([[0], [t]], np.nan, 1.0), "run 1: .* of panda_joint1 at 0.001 s is nan"),
    ]  # fmt: skip
    for law, words in laws:
        with pytest.raises(CommandError, match=words):
            batch.run(law, 10)
    for make, words in [
        (lambda: MujocoBatch([]), "at least one plant"),
        (lambda: MujocoBatch([plant], 0), "threads must be a whole number of at least 1; got 0"),
        (lambda: MujocoBatch([plant], 1.5), "threads must be a whole number of at least 1; got 1.5"),
        (lambda: MujocoBatch([plant, other]), "run 1: its plant has another"),
        (lambda: batch.run(hold, 0), "steps must be a whole number of at least 1; got 0"),
        (lambda: batch.run(hold, 2.5), "steps must be a whole number of at least 1; got 2.5"),
    ]:
        with pytest.raises(CommandError, match=words):
            make()


def one_run(joint: int, effort: float) -> Law:
    """Return the law `hold` with an additional effort at one joint of run 4."""
    return lambda t, q, dq: hold(t, q, dq) + effort * np.outer(np.arange(6) == 4, np.arange(7) == joint)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_stop_names_the_run_and_the_batch_remains_usable(panda_urdf, threads):
    plant = MujocoPlant(panda_urdf, PANDA, {})
    batch = MujocoBatch((start(plant, run) for run in range(6)), threads)
    with pytest.raises(FailureError, match=r"^run 4 of the batch: a joint reaches its stop at 0\.\d+ s; "):
        batch.run(one_run(5, 300.0), 2000)
    assert batch.run(hold, 50).q.tobytes() == batch.run(hold, 50).q.tobytes()


def test_contact_and_divergence_name_the_run(wide_panda_urdf):
    plant = MujocoPlant(wide_panda_urdf, PANDA, {})
    batch = MujocoBatch((start(plant, run) for run in range(6)), 2)
    with pytest.raises(FailureError, match=r"^run 4 of the batch: two shapes come into contact at 0\.\d+ s; "):
        batch.run(one_run(3, -300.0), 2000)
    with pytest.raises(
        FailureError, match=r"^run 4 of the batch: the simulation diverged at 0\.\d+ s: speed of panda_joint7"
    ):
        batch.run(one_run(6, 1e4), 2000)
