"""External torque and wrench against wrenches that act on the real plant; every field of the state; the parameters of
the box."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

import panda_description
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.robot_state import FIELD_NAMES, RobotState
from franka_hw_interface.transforms import column_major
from franka_sim.box.config import BoxConfig, CollisionBehavior
from franka_sim.box.configuration import friction_law
from franka_sim.box.motion.run import PacketCount
from franka_sim.box.self_collision import SelfCollision
from hric_core.errors import ParameterError
from hric_core.parameters import declared

FRICTION = panda_description.friction_parameters()
IDENTIFIED = {"friction": "identified", "friction_parameters": FRICTION}
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
WRENCHES = [
    ((10.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((-3.0, 6.0, 8.0), (0.5, -1.0, 0.8)),
    ((0.0, 0.0, 0.0), (0.0, 2.0, 0.0)),
]


def wide(arm) -> None:
    arm.box.set_collision_behavior(*[[1e3] * 7] * 4, *[[1e4] * 6] * 4)


@pytest.mark.parametrize("wrench", WRENCHES)
def test_a_wrench_on_the_flange_shows_with_the_sign_of_what_the_arm_exerts(make_box, wrench) -> None:
    arm = make_box()
    force, torque = wrench
    T = arm.box.model.F_T_EE.copy()
    arm.box.set_EE_T_K(column_major(np.linalg.inv(T)))  # the stiffness frame at the flange, where the plant applies it
    arm.plant.apply_wrench("panda_link8", force, torque, (0.0, 0.0, 0.0), -1.0)
    for _ in range(1500):
        arm.cycle()
    state, model = arm.state, arm.box.model
    acting = np.array([*force, *torque])
    J = model.zero_jacobian(FrankaFrame.FLANGE, state.q)
    assert np.array(state.tau_ext_hat_filtered) == pytest.approx(-J.T @ acting, abs=2e-3)
    assert np.array(state.O_F_ext_hat_K) == pytest.approx(-acting, abs=5e-3)
    R = model.pose(FrankaFrame.FLANGE, state.q)[:3, :3]
    assert np.array(state.K_F_ext_hat_K) == pytest.approx(-np.concatenate([R.T @ force, R.T @ torque]), abs=5e-3)


def test_the_estimate_follows_a_push_with_the_time_constant_of_its_filter(make_box, torques) -> None:
    arm = make_box()
    wide(arm)
    arm.start()
    arm.plant.apply_wrench("panda_link8", (0.0, 10.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    seen = []
    for _ in range(60):
        arm.cycle(torques())
        J = arm.box.model.zero_jacobian(FrankaFrame.FLANGE, arm.state.q)
        seen.append(arm.state.tau_ext_hat_filtered[0] / float(-(J.T @ [0.0, 10.0, 0.0, 0.0, 0.0, 0.0])[0]))
    constant = 1.0 / (2.0 * math.pi * arm.box.config.external_torque_cutoff)
    for cycles in (4, 8, 16, 60):
        assert seen[cycles - 1] == pytest.approx(1.0 - math.exp(-cycles * 1e-3 / constant), abs=0.01)


def test_a_free_arm_in_motion_feels_no_external_torque(make_box, torques) -> None:
    arm = make_box(plant=IDENTIFIED, config={"friction": FRICTION})
    arm.start()
    worst, fastest = 0.0, 0.0
    for k in range(2000):
        wave = math.sin(2.0 * math.pi * 1e-3 * k)
        tau = [8.0 * wave, 6.0 * wave, 3.0 * wave, -4.0 * wave, wave, -wave, wave]
        arm.cycle(torques(*[min(max(t, b - 0.9), b + 0.9) for t, b in zip(tau, arm.state.tau_J_d, strict=True)]))
        worst, fastest = max(worst, *map(abs, arm.state.tau_ext_hat_filtered)), max(fastest, *map(abs, arm.state.dq))
    assert fastest > 0.5
    assert worst < 0.2


def test_friction_and_loads_that_the_box_does_not_know_show_as_external_torque(make_box, torques) -> None:
    from hric_control.plant import Load

    arm = make_box()
    arm.plant.set_load(Load(1.0), "panda_link8")
    for _ in range(2000):
        arm.cycle()
    assert arm.state.O_F_ext_hat_K[2] == pytest.approx(9.81, abs=0.05)  # the arm lifts
    arm.box.set_load(1.0, [0.0] * 3, [0.0] * 9)
    for _ in range(2000):
        arm.cycle()
    assert max(map(abs, arm.state.tau_ext_hat_filtered)) < 1e-3


def test_the_wrench_is_zero_near_a_singular_pose(make_box) -> None:
    arm = make_box(q=[0.0, 0.0, 0.0, -0.07, 0.0, 0.5, 0.0])
    arm.plant.apply_wrench("panda_link8", (10.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), -1.0)
    for _ in range(100):
        arm.cycle()
    assert max(map(abs, arm.state.tau_ext_hat_filtered)) > 1.0
    assert arm.state.O_F_ext_hat_K == arm.state.K_F_ext_hat_K == [0.0] * 6


def test_thresholds_of_the_acceleration_phase_hold_while_the_desired_motion_accelerates(make_box) -> None:
    arm = make_box()
    arm.box.set_collision_behavior(
        [1.0] * 7, [2.0] * 7, [3.0] * 7, [4.0] * 7, [5.0] * 6, [6.0] * 6, [7.0] * 6, [8.0] * 6
    )
    assert (arm.state.lower(), arm.state.upper()) == (((3.0,) * 7, (7.0,) * 6), ((4.0,) * 7, (8.0,) * 6))
    arm.state.ddq_d[2] = 0.1
    assert (arm.state.lower(), arm.state.upper()) == (((1.0,) * 7, (5.0,) * 6), ((2.0,) * 7, (6.0,) * 6))


def test_every_field_of_the_state_is_filled_and_has_its_length(make_box, torques) -> None:
    arm = make_box()
    arm.box.set_load(0.5, [0.0, 0.0, 0.05], [1e-3, 0, 0, 0, 1e-3, 0, 0, 0, 1e-3])
    arm.start()
    for k in range(300):
        arm.cycle(torques(*[min(0.9 * k, 1.5)] * 5, 0.3, 0.1))
    state, empty, kept = arm.state, RobotState(), arm.state.snapshot()
    for name in FIELD_NAMES:
        value, usual = getattr(kept, name), getattr(empty, name)
        assert type(value) is type(usual), name
        assert not isinstance(value, list) or (
            len(value) == len(usual) and all(type(x) is float and math.isfinite(x) for x in value)
        ), name
    measured, desired = (column_major(arm.box.model.pose(FrankaFrame.END_EFFECTOR, q)) for q in (state.q, state.q_d))
    assert pytest.approx(measured, abs=1e-15) == state.O_T_EE
    assert state.O_T_EE_d == state.O_T_EE_c == pytest.approx(desired, abs=1e-15)
    assert state.elbow == [state.q[2], -1.0]
    assert (state.theta, state.dtheta, state.O_ddP_O) == (state.q, state.dq, [0.0, 0.0, -9.81])
    assert state.time == pytest.approx(0.302)
    before = state.tau_J[:]
    arm.cycle(torques(*[1.0] * 5, 0.3, 0.1))
    assert state.dtau_J == pytest.approx([(b - a) * 1e3 for a, b in zip(before, state.tau_J, strict=True)])


def test_what_nobody_reads_is_not_computed(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    arm.state.computed_at.clear()
    for _ in range(50):
        arm.cycle(torques(0.5, 0.5, 0.5, 0.5, 0.1, 0.1, 0.1))
    assert arm.state.computed_at == {}


def test_the_links_clearance_is_that_of_the_capsules(make_box) -> None:
    bodies = SelfCollision(make_box().box.model, BoxConfig())
    assert bodies.clearance([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]) > 0.05
    assert bodies.nearest([0.0, 0.5, 0.0, -3.0, 0.0, 2.5, 0.785]) == ("link0", "hand")
    assert bodies.too_near([math.nan] * 7) and not bodies.too_near([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])


def test_the_bound_on_speeds_is_never_too_small(make_box) -> None:
    """Reach of each joint: no point that the capsules have moves faster than the sum of |dq_i| reach_i."""
    arm, config = make_box(), BoxConfig()
    bodies, rng = SelfCollision(arm.box.model, config), np.random.default_rng(2)
    step = 1e-5
    for _ in range(100):
        q = rng.uniform(config.limits.lower, config.limits.upper)
        dq = rng.uniform(-1.0, 1.0, 7)
        change = np.abs(bodies._distances((q + step * dq).tolist()) - bodies._distances(q.tolist())).max() / step
        assert change <= np.abs(dq) @ config.reach + 1e-3
        for i in range(7):
            single = np.eye(7)[i] * step
            assert (
                np.abs(bodies._distances((q + single).tolist()) - bodies._distances(q.tolist())).max() / step
                <= config.reach[i]
            )


def test_success_rate_counts_the_last_hundred_cycles_from_the_first_command() -> None:
    packets = PacketCount(100)
    packets.lose()
    assert (packets.success_rate, packets.lost_in_a_row) == (0.0, 0)
    rates = []
    for k in range(400):
        packets.accept() if k % 4 else packets.lose()
        rates.append(packets.success_rate)
    assert rates[0] == 0.0
    assert rates[1] == 1.0
    assert rates[150:] == pytest.approx([0.75] * 250)
    for _ in range(100):
        packets.accept()
    assert packets.success_rate == 1.0
    for _ in range(30):
        packets.lose()
    assert (packets.success_rate, packets.lost_in_a_row) == (pytest.approx(0.7), 30)


def test_the_friction_law_is_the_plants() -> None:
    from hric_control.plants.friction import sigmoid_parameters, sigmoid_torque

    dq = [0.3, -0.2, 0.1, 1.5, -2.0, 0.0, 0.01]
    plant = [sigmoid_torque(v, phi) for v, phi in zip(dq, sigmoid_parameters(FRICTION, JOINTS), strict=True)]
    assert friction_law(FRICTION, JOINTS)(dq) == pytest.approx(plant, abs=1e-15)
    assert friction_law(FRICTION, JOINTS)([0.0] * 7) == [0.0] * 7
    with pytest.raises(ParameterError, match="friction_parameters: phi1, phi2 and phi3 of panda_joint7 are missing"):
        friction_law({name: FRICTION[name] for name in JOINTS[:6]}, JOINTS)
    with pytest.raises(ParameterError, match="phi1, phi2 and phi3 of panda_joint3 are missing or not numbers"):
        friction_law({**FRICTION, "panda_joint3": {"phi1": math.nan, "phi2": 1.0, "phi3": 0.0}}, JOINTS)


def test_the_parameters_are_those_of_the_file_and_wrong_ones_are_named() -> None:
    values = yaml.safe_load((Path(__file__).parents[1] / "config" / "control_box.yaml").read_text())
    config, attributes = BoxConfig(), {parameter.name: key for key, parameter in declared(BoxConfig).items()}
    for name, value in values.items():
        expected = (
            CollisionBehavior(**value)
            if name == "collision_behavior"
            else tuple(value)
            if isinstance(value, list)
            else value
        )
        assert getattr(config, attributes[name]) == expected
    for name, wrong in (
        ("time_step", 0.0),
        ("max_lost_packets", 0),
        ("reach", (1.0,) * 6),
        ("position_margin", math.nan),
        ("success_window", 1.5),
    ):
        with pytest.raises(ParameterError, match=name):
            BoxConfig(**{name: wrong})
