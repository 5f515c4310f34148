"""The control box on the real plant: hold, torque control, lost packets, success rate, requests and their responses."""

import pytest

import panda_description
from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, RequestOutcome

FRICTION = panda_description.friction_parameters()
IDENTIFIED = {"friction": "identified", "friction_parameters": FRICTION}
TORQUE = MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE)


def moved(arm, q) -> float:
    return max(abs(a - b) for a, b in zip(arm.state.q, q, strict=True))


def pd(arm, goal, kp: float, kd: float) -> list[float]:
    """Return PD torques whose rate is within the limit, as a client limits it."""
    s = arm.state
    wanted = [kp * (g - q) - kd * dq for g, q, dq in zip(goal, s.q, s.dq, strict=True)]
    return [min(max(t, b - 0.999), b + 0.999) for t, b in zip(wanted, s.tau_J_d, strict=True)]


def drift(arm, torques, cycles: int) -> float:
    q = arm.state.q[:]
    arm.start()
    worst = 0.0
    for _ in range(cycles):
        arm.cycle(torques())
        worst = max(worst, moved(arm, q))
    assert arm.box.mode is RobotMode.MOVE
    return worst


@pytest.mark.parametrize("rotors", [0.1, 0.0])
def test_zero_torque_holds_with_gravity_and_friction_compensated(make_box, torques, rotors) -> None:
    arm = make_box(
        plant={**IDENTIFIED, "rotor_inertia": rotors}, config={"friction": FRICTION, "rotor_inertia": (rotors,) * 7}
    )
    assert drift(arm, torques, 3000) < 1e-6


@pytest.mark.slow
def test_zero_torque_holds_for_60_s_with_gravity_and_friction_compensated(make_box, torques) -> None:
    assert drift(make_box(plant=IDENTIFIED, config={"friction": FRICTION}), torques, 60_000) < 1e-6


def coasting(arm, torques) -> float:
    """Share of the speed of joint 1 that is left after half a second without torque."""
    arm.start()
    for _ in range(200):
        arm.cycle(torques(1.0, 0, 0, 0, 0, 0, 0))
    before = arm.state.dq[0]
    for _ in range(500):
        arm.cycle(torques())
    return arm.state.dq[0] / before


def test_compensated_friction_lets_the_arm_coast_and_friction_that_the_box_does_not_know_brakes_it(
    make_box, torques
) -> None:
    assert coasting(make_box(plant=IDENTIFIED, config={"friction": FRICTION}), torques) > 0.95
    assert coasting(make_box(plant=IDENTIFIED), torques) < 0.8


@pytest.mark.parametrize("generator", [GeneratorMode.NONE, GeneratorMode.JOINT_VELOCITY])
def test_a_pd_law_through_the_box_moves_the_arm_to_its_goal_and_the_arm_then_holds_there(
    make_box, torques, generator
) -> None:
    arm = make_box(plant=IDENTIFIED, config={"friction": FRICTION})
    goal = [q + 0.2 for q in arm.state.q]
    arm.start(generator=generator)
    for _ in range(4000):
        arm.cycle(torques(*pd(arm, goal, 50.0, 15.0)))
    assert moved(arm, goal) < 1e-3
    assert arm.state.control_command_success_rate == 1.0
    arm.cycle(torques(finished=True))
    assert (arm.box.mode, arm.box.take_finished(), arm.box.take_finished()) == (
        RobotMode.IDLE,
        RequestOutcome.SUCCESS,
        None,
    )
    assert (arm.state.controller_mode, arm.state.generator_mode) == (ControllerMode.OTHER, GeneratorMode.IDLE)
    assert arm.state.control_command_success_rate == 0.0
    q = arm.state.q[:]
    for _ in range(1000):
        arm.cycle()
    assert moved(arm, q) < 1e-3
    assert max(map(abs, arm.state.dq)) < 1e-3


def test_tau_J_d_is_the_accepted_command_without_gravity_and_tau_J_holds_gravity(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    assert arm.state.tau_J_d == [0.0] * 7
    arm.cycle(torques(0.5, -0.5, 0.4, -0.4, 0.3, -0.3, 0.2))
    assert arm.state.tau_J_d == [0.5, -0.5, 0.4, -0.4, 0.3, -0.3, 0.2]
    gravity = arm.box.model.gravity_list(arm.state.q)
    motors = arm.plant.motor_effort()
    assert motors == pytest.approx([a + b for a, b in zip(arm.state.tau_J_d, gravity, strict=True)], abs=1e-3)
    rotors = [b * rate * 1e3 for b, rate in zip(arm.box.config.rotor_inertia, arm.state.dq, strict=True)]
    assert arm.state.tau_J == pytest.approx([tau - taken for tau, taken in zip(motors, rotors, strict=True)], abs=1e-12)


def test_a_lost_packet_repeats_the_last_torque_and_counts(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    command = torques(0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
    for _ in range(90):
        arm.cycle(command)
    for _ in range(10):
        arm.cycle()
    assert arm.state.tau_J_d == command.tau
    assert arm.state.control_command_success_rate == pytest.approx(0.9)
    for _ in range(100):
        arm.cycle(torques())
    assert arm.state.control_command_success_rate == 1.0


def test_states_before_the_first_command_are_not_lost_packets(make_box) -> None:
    arm = make_box()
    arm.start()
    for _ in range(100):
        arm.cycle()
    assert arm.box.mode is RobotMode.MOVE


def test_a_low_pass_of_the_controller_slows_torques(make_box, torques) -> None:
    arm = make_box()
    assert arm.box.set_filters([1000.0, 1000.0, 1000.0, 1000.0, 100.0]) is RequestOutcome.SUCCESS
    arm.start()
    arm.cycle(torques(*[0.9] * 7))
    assert arm.state.tau_J_d == pytest.approx([0.9 * 0.46651] * 7, rel=1e-4)  # 1 - exp(-2 pi 100 Hz 1 ms)


def test_stop_preempts_a_motion_and_is_fine_at_idle(make_box, torques) -> None:
    arm = make_box()
    assert arm.box.stop_move() is RequestOutcome.SUCCESS
    assert arm.box.take_finished() is None
    arm.start()
    assert arm.box.move(TORQUE) is RequestOutcome.NOT_POSSIBLE
    assert arm.box.stop_move() is RequestOutcome.SUCCESS
    assert (arm.box.mode, arm.box.take_finished()) == (RobotMode.IDLE, RequestOutcome.PREEMPTED)


def test_a_lost_connection_aborts_a_motion(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    arm.box.connection_lost()
    assert (arm.box.mode, arm.box.take_finished()) == (RobotMode.IDLE, RequestOutcome.ABORTED)
    arm.start()


def test_the_user_stop_ends_a_motion_forbids_the_next_one_and_is_left_by_releasing_it(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    assert arm.box.set_user_stop(True) is RequestOutcome.SUCCESS
    assert (arm.box.mode, arm.box.take_finished()) == (RobotMode.USER_STOPPED, RequestOutcome.EMERGENCY_ABORTED)
    assert arm.box.move(TORQUE) is RequestOutcome.NOT_POSSIBLE
    assert arm.box.recover() is RequestOutcome.NOT_POSSIBLE
    arm.box.set_user_stop(False)
    assert arm.box.recover() is RequestOutcome.SUCCESS
    arm.start()
    assert arm.reports == ["user stop pressed", "user stop released"]


def test_a_guided_arm_follows_a_push_and_stays_where_it_was_left(make_box) -> None:
    arm = make_box()
    q = arm.state.q[:]
    assert arm.box.set_guiding(True) is RequestOutcome.SUCCESS
    assert arm.box.move(TORQUE) is RequestOutcome.NOT_POSSIBLE
    arm.plant.apply_wrench("panda_link8", (0.0, 5.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.5)
    for _ in range(500):
        arm.cycle()
    assert moved(arm, q) > 0.05
    assert arm.box.set_guiding(False) is RequestOutcome.SUCCESS
    for _ in range(500):
        arm.cycle()
    q = arm.state.q[:]
    for _ in range(500):
        arm.cycle()
    assert moved(arm, q) < 1e-4


@pytest.mark.parametrize(
    "request_",
    [
        MoveRequest(ControllerMode.OTHER, GeneratorMode.NONE),
        MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.IDLE),
        MoveRequest(ControllerMode.JOINT_IMPEDANCE, GeneratorMode.NONE),
        MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE, max_path_deviation=(float("nan"), 1.0, 1.0)),
    ],
    ids=["no controller", "no generator", "impedance without motion", "NaN"],
)
def test_a_request_that_makes_no_sense_is_refused(make_box, request_) -> None:
    arm = make_box()
    assert arm.box.move(request_) is RequestOutcome.INVALID_ARGUMENT
    assert arm.box.mode is RobotMode.IDLE


def test_settings_are_refused_while_a_motion_runs_unless_configured_and_wrong_ones_always(make_box) -> None:
    load = (1.0, [0.0, 0.0, 0.1], [1e-3, 0, 0, 0, 1e-3, 0, 0, 0, 1e-3])
    arm = make_box()
    assert arm.box.set_load(*load) is RequestOutcome.SUCCESS
    assert (arm.state.m_load, arm.state.m_total) == (1.0, pytest.approx(1.0 + arm.state.m_ee))
    assert arm.box.set_load(-1.0, *load[1:]) is RequestOutcome.INVALID_ARGUMENT
    assert arm.state.m_load == 1.0
    assert arm.box.set_collision_behavior([1.0] * 7) is RequestOutcome.INVALID_ARGUMENT
    assert arm.box.set_joint_impedance([float("nan")] * 7) is RequestOutcome.INVALID_ARGUMENT
    assert arm.box.set_EE_T_K([1.0] * 16) is RequestOutcome.INVALID_ARGUMENT
    arm.start()
    assert arm.box.set_load(*load) is RequestOutcome.NOT_POSSIBLE
    other = make_box(config={"settings_while_moving": True})
    other.start()
    assert other.box.set_load(*load) is RequestOutcome.SUCCESS


def test_reset_places_the_arm_idle_and_aborts_a_motion(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    arm.cycle(torques(*[0.9] * 7))
    q = [0.1, -0.5, 0.1, -2.0, 0.1, 1.5, 0.5]
    arm.place(q)
    assert (arm.box.mode, arm.box.take_finished(), arm.state.q_d) == (RobotMode.IDLE, RequestOutcome.ABORTED, q)
    for _ in range(100):
        arm.cycle()
    assert moved(arm, q) < 1e-9
