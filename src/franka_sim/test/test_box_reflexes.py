"""Each reflex on the real plant: it stops the motion, names libfranka's error, refuses motion, and recovery leads back
to idle."""

import pytest

from franka_hw_interface.robot_state import NO_ERRORS, RobotMode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, RequestOutcome

TORQUE = MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE)


def check_reflex(arm, name: str) -> None:
    """Assert all signs of a reflex, and that recovery leads back to idle."""
    box, state = arm.box, arm.state
    assert state.current_errors == state.last_motion_errors == {name}
    assert (box.mode, box.take_finished()) == (RobotMode.REFLEX, RequestOutcome.REFLEX_ABORTED)
    assert (state.controller_mode, state.generator_mode) == (ControllerMode.OTHER, GeneratorMode.IDLE)
    assert any(name in line for line in arm.reports)
    assert box.move(TORQUE) is RequestOutcome.NOT_POSSIBLE
    for _ in range(1500):
        arm.cycle()
    assert max(map(abs, state.dq)) < 1e-2
    assert box.recover() is RequestOutcome.SUCCESS
    assert (box.mode, state.current_errors, state.last_motion_errors) == (RobotMode.IDLE, NO_ERRORS, {name})
    assert state.joint_collision == [0.0] * 7
    assert box.move(TORQUE) is RequestOutcome.STARTED


def ramp(arm, torques, joint: int, slope: float, limit: float):
    """Return a law whose torque on one joint grows by `slope` per cycle up to `limit` [N m]."""

    def command():
        tau = [0.0] * 7
        tau[joint] = max(min(arm.state.tau_J_d[joint] + slope, limit), -limit)
        return torques(*tau)

    return command


def test_a_torque_jump_is_a_discontinuity(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    arm.cycle(torques(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0))
    assert arm.box.mode is RobotMode.MOVE
    arm.cycle(torques(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.01))
    assert arm.state.tau_J_d[6] < 1.5
    check_reflex(arm, "controller_torque_discontinuity")


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_torque_that_is_no_number_is_a_discontinuity(make_box, torques, bad) -> None:
    arm = make_box()
    arm.start()
    arm.cycle(torques(0.0, 0.0, bad, 0.0, 0.0, 0.0, 0.0))
    assert all(abs(x) < 100.0 for x in arm.state.tau_J)
    check_reflex(arm, "controller_torque_discontinuity")


def test_a_torque_beyond_the_limit_is_out_of_range(make_box, torques) -> None:
    # The arm is braked, or it would be too fast before the torque is too large.
    arm = make_box()
    arm.plant.set_brakes([True] * 7)
    arm.box.set_collision_behavior(*[[1e3] * 7] * 4, *[[1e4] * 6] * 4)
    arm.start()
    arm.until_reflex(ramp(arm, torques, 6, 0.9, 13.0), 20)
    check_reflex(arm, "tau_j_range_violation")


def test_twenty_lost_packets_in_a_row_end_a_motion_and_nineteen_do_not(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    for _ in range(2):
        arm.cycle(torques())
        for _ in range(19):
            arm.cycle()
        assert arm.box.mode is RobotMode.MOVE
    arm.cycle()
    check_reflex(arm, "communication_constraints_violation")


def test_any_number_of_packets_may_be_lost_where_the_rule_is_off(make_box, torques) -> None:
    arm = make_box(config={"max_lost_packets": None})
    arm.start()
    arm.cycle(torques())
    for _ in range(100):
        arm.cycle()
    assert arm.box.mode is RobotMode.MOVE


def test_a_joint_that_is_too_fast_stops(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    assert arm.until_reflex(ramp(arm, torques, 6, 0.5, 3.0), 2000)
    assert abs(arm.state.dq[6]) > 2.61
    assert "panda_joint7" in arm.reports[-1]
    assert "limit 2.61" in arm.reports[-1]
    check_reflex(arm, "joint_velocity_violation")


def test_an_end_effector_that_is_too_fast_stops_though_no_joint_is(make_box, torques) -> None:
    arm = make_box(q=[-1.0, 0.0, 0.0, -1.8, 0.0, 1.6, 0.785])
    wanted, begin = [1.8, -1.7, 0.0, 1.8, 0.0, 1.5, 0.0], arm.cycles

    def command():
        share = min((arm.cycles - begin) * 2e-3, 1.0)
        rows = zip(wanted, arm.state.dq, arm.state.tau_J_d, strict=True)
        return torques(*(min(max(20.0 * (share * v - dq), tau - 0.9), tau + 0.9) for v, dq, tau in rows))

    arm.box.set_collision_behavior(*[[1e3] * 7] * 4, *[[1e4] * 6] * 4)
    arm.start()
    assert arm.until_reflex(command, 2000)
    limits = arm.box.config.limits
    assert all(abs(v) < limit for v, limit in zip(arm.state.dq, limits.velocity, strict=True))
    check_reflex(arm, "cartesian_velocity_violation")


def test_a_joint_that_reaches_its_limit_stops_and_may_then_move_inwards(make_box, torques) -> None:
    arm = make_box(q=[2.85, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    arm.start()
    assert arm.until_reflex(ramp(arm, torques, 0, 0.5, 2.0), 3000)
    check_reflex(arm, "joint_position_limits_violation")
    before = arm.state.q[0]
    arm.until_reflex(ramp(arm, torques, 0, -0.5, 2.0), 300)
    assert arm.box.mode is RobotMode.MOVE
    assert arm.state.q[0] < before - 0.01


def test_a_start_beyond_a_limit_may_move_inwards_and_not_outwards(make_box, torques) -> None:
    beyond = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]  # the thesis's start: joint 4 ends at -0.0698
    arm = make_box(q=beyond)
    arm.start()
    arm.until_reflex(ramp(arm, torques, 3, -0.5, 2.0), 200)
    assert arm.box.mode is RobotMode.MOVE
    assert arm.state.q[3] < -0.005
    arm = make_box(q=beyond)
    arm.start()
    assert arm.until_reflex(ramp(arm, torques, 3, 0.5, 2.0), 500)
    check_reflex(arm, "joint_position_limits_violation")


def test_links_that_come_too_near_to_each_other_stop(make_box, torques) -> None:
    arm = make_box(q=[0.0, -0.785, 0.0, -2.356, 0.0, 0.3, 0.785])
    clearance = arm.box._reflexes._bodies.clearance
    assert clearance(arm.state.q) > 0.01
    arm.start()
    assert arm.until_reflex(ramp(arm, torques, 5, -0.3, 1.0), 4000)
    assert clearance(arm.state.q) == pytest.approx(0.005, abs=0.004)
    assert arm.state.q[5] > -0.0165
    check_reflex(arm, "self_collision_avoidance_violation")


def test_a_push_above_the_threshold_of_a_joint_is_a_joint_reflex(make_box, torques) -> None:
    arm = make_box()
    arm.box.set_collision_behavior(*[[5.0] * 7, [8.0] * 7] * 2, *[[1e3] * 6] * 4)
    arm.start()
    arm.plant.apply_wrench("panda_link5", (0.0, 0.0, -40.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.2)
    assert arm.until_reflex(torques, 200) == {"joint_reflex"}
    assert any(arm.state.joint_collision)
    for _ in range(400):
        arm.cycle()
    assert any(arm.state.joint_collision), "latched until recovery"
    assert not any(arm.state.joint_contact), "gone with the push"
    check_reflex(arm, "joint_reflex")


def test_a_push_above_the_threshold_of_the_end_effector_is_a_cartesian_reflex(make_box, torques) -> None:
    arm = make_box()
    arm.box.set_collision_behavior(*[[100.0] * 7] * 4, *[[5.0] * 6, [8.0] * 6] * 2)
    arm.start()
    arm.plant.apply_wrench("panda_link8", (12.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.2)
    assert arm.until_reflex(torques, 200) == {"cartesian_reflex"}
    assert any(arm.state.cartesian_collision)
    for _ in range(400):
        arm.cycle()
    check_reflex(arm, "cartesian_reflex")


def test_a_push_below_the_thresholds_is_a_contact_and_no_collision(make_box, torques) -> None:
    arm = make_box()
    arm.box.set_collision_behavior(*[[1.0] * 7, [80.0] * 7] * 2, *[[3.0] * 6, [80.0] * 6] * 2)
    arm.start()
    arm.plant.apply_wrench("panda_link8", (8.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1)
    for _ in range(80):
        arm.cycle(torques())
    assert arm.box.mode is RobotMode.MOVE
    assert any(arm.state.joint_contact)
    assert any(arm.state.cartesian_contact)
    assert not any(arm.state.joint_collision + arm.state.cartesian_collision)


def test_without_reflexes_torques_are_limited_and_the_motion_goes_on(make_box, torques) -> None:
    arm = make_box(config={"reflexes": False})
    arm.start()
    arm.cycle(torques(50.0, 0, 0, 0, 0, 0, 0))
    assert arm.state.tau_J_d[0] == pytest.approx(1.0, rel=2e-3)
    for _ in range(50):
        arm.cycle()
    assert arm.box.mode is RobotMode.MOVE
    arm.cycle(torques(float("nan"), 0, 0, 0, 0, 0, 0))
    assert arm.box.mode is RobotMode.REFLEX


def test_the_user_stop_in_reflex_clears_the_errors_when_it_is_released(make_box, torques) -> None:
    arm = make_box()
    arm.start()
    arm.cycle(torques(*[9.0] * 7))
    arm.box.set_user_stop(True)
    assert arm.state.current_errors
    arm.box.set_user_stop(False)
    assert (arm.box.mode, arm.state.current_errors) == (RobotMode.IDLE, NO_ERRORS)
