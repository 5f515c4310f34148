"""The commands that the limiters return."""

import logging
import math
import random

import pytest

from hric_control.hardware_interface import JointCommands, JointStates
from hric_control.limits import EffortLimiter, JointLimits, PositionLimiter, VelocityLimiter, stopping_speed
from hric_core.errors import HricError, UnknownNameError

DT = 0.001


def make(kind, *limits: JointLimits):
    states = JointStates([limit.name for limit in limits])
    commands = JointCommands(states)
    return states, commands, kind(states, commands, limits)


def one(kind, **values):
    return make(kind, JointLimits("j", **values))


def send(limiter, commands, value):
    commands.value[0] = value
    limiter.enforce(DT)
    return commands.value[0]


class TestEffort:
    def test_an_effort_within_all_limits_passes_unchanged_and_uncounted(self):
        _, commands, limiter = one(EffortLimiter, lower=-1.0, upper=1.0, velocity=2.0, effort=10.0, effort_rate=1000.0)
        limiter.reset([0.0])
        assert send(limiter, commands, 0.7) == 0.7
        assert limiter.counts.total == 0
        assert limiter.counts.cycles == 1

    @pytest.mark.parametrize(("wanted", "sent"), [(11.0, 10.0), (-11.0, -10.0), (10.0, 10.0)])
    def test_effort_is_cut_to_the_largest_effort(self, wanted, sent):
        _, commands, limiter = one(EffortLimiter, effort=10.0)
        assert send(limiter, commands, wanted) == sent
        assert limiter.counts.effort == [int(wanted != sent)]

    @pytest.mark.parametrize(
        ("q", "wanted", "sent"),
        [(1.1, 5.0, 0.0), (1.1, -5.0, -5.0), (-1.1, -5.0, 0.0), (-1.1, 5.0, 5.0), (1.0, 5.0, 5.0)],
    )
    def test_outside_the_range_only_inward_effort_passes(self, q, wanted, sent):
        states, commands, limiter = one(EffortLimiter, lower=-1.0, upper=1.0)
        states.position[0] = q
        assert send(limiter, commands, wanted) == sent
        assert limiter.counts.position == [int(wanted != sent)]

    @pytest.mark.parametrize(
        ("v", "wanted", "sent"),
        [(2.1, 5.0, 0.0), (2.1, -5.0, -5.0), (-2.1, -5.0, 0.0), (-2.1, 5.0, 5.0), (2.0, 5.0, 5.0)],
    )
    def test_above_the_velocity_limit_only_braking_effort_passes(self, v, wanted, sent):
        states, commands, limiter = one(EffortLimiter, velocity=2.0)
        states.velocity[0] = v
        assert send(limiter, commands, wanted) == sent
        assert limiter.counts.velocity == [int(wanted != sent)]

    def test_the_effort_rate_is_limited_last_so_that_a_stop_cannot_make_a_step(self):
        states, commands, limiter = one(EffortLimiter, lower=-1.0, upper=1.0, effort=10.0, effort_rate=1000.0)
        limiter.reset([9.0])
        states.position[0] = 1.5
        assert send(limiter, commands, 9.0) == 8.0
        assert (limiter.counts.position, limiter.counts.effort_rate) == ([1], [1])

    def test_the_rate_counts_from_what_was_sent_not_from_what_was_wanted(self):
        _, commands, limiter = one(EffortLimiter, effort_rate=1000.0)
        limiter.reset([0.0])
        assert [send(limiter, commands, 100.0) for _ in range(3)] == [1.0, 2.0, 3.0]

    def test_after_a_reset_without_a_value_the_first_effort_passes_the_rate_limit(self):
        _, commands, limiter = one(EffortLimiter, effort_rate=1000.0)
        assert send(limiter, commands, 50.0) == 50.0
        assert send(limiter, commands, 80.0) == 51.0
        limiter.reset(None)
        assert send(limiter, commands, -20.0) == -20.0

    def test_the_rate_follows_the_period(self):
        _, commands, limiter = one(EffortLimiter, effort_rate=1000.0)
        limiter.reset([0.0])
        commands.value[0] = 100.0
        limiter.enforce(0.002)
        assert commands.value[0] == 2.0

    def test_a_soft_range_allows_less_speed_the_nearer_the_end(self):
        states, commands, limiter = one(
            EffortLimiter,
            lower=-1.0,
            upper=1.0,
            velocity=2.0,
            effort=100.0,
            k_position=10.0,
            k_velocity=20.0,
            soft_lower=-0.9,
            soft_upper=0.9,
        )
        states.position[0], states.velocity[0] = 0.85, 0.3
        # 10 (0.9 - 0.85) = 0.5 rad/s allowed; 20 (0.5 - 0.3) = 4 N m left.
        assert send(limiter, commands, 50.0) == pytest.approx(4.0)
        assert limiter.counts.position == [1]
        states.velocity[0] = 0.8
        assert send(limiter, commands, 50.0) == pytest.approx(-6.0)
        assert send(limiter, commands, -50.0) == pytest.approx(-50.0)

    def test_a_soft_velocity_limit_fades_the_effort_out_before_the_limit(self):
        states, commands, limiter = one(EffortLimiter, velocity=2.0, effort=100.0, k_velocity=20.0)
        states.velocity[0] = 1.9
        assert send(limiter, commands, 50.0) == pytest.approx(2.0)
        assert (limiter.counts.velocity, limiter.counts.position) == ([1], [0])
        states.velocity[0] = 2.5
        assert send(limiter, commands, 50.0) == pytest.approx(-10.0)

    def test_outside_the_range_soft_limits_never_push_outwards(self):
        states, commands, limiter = one(
            EffortLimiter,
            lower=-1.0,
            upper=1.0,
            velocity=2.0,
            effort=100.0,
            k_position=10.0,
            k_velocity=20.0,
            soft_lower=-1.0,
            soft_upper=1.0,
        )
        states.position[0], states.velocity[0] = 1.2, -5.0  # coming in faster than the velocity limit
        assert send(limiter, commands, 50.0) == 0.0
        states.position[0], states.velocity[0] = -1.2, 5.0
        assert send(limiter, commands, -50.0) == 0.0

    def test_a_start_outside_is_not_pushed_in_and_soft_limits_act_once_it_has_been_inside(self):
        states, commands, limiter = one(
            EffortLimiter,
            lower=-1.0,
            upper=1.0,
            velocity=2.0,
            effort=100.0,
            k_position=10.0,
            k_velocity=20.0,
            soft_lower=-1.0,
            soft_upper=1.0,
        )
        states.position[0] = 1.2
        assert send(limiter, commands, -3.0) == -3.0
        assert send(limiter, commands, 3.0) == 0.0
        states.position[0] = 0.99
        send(limiter, commands, 0.0)
        states.position[0] = 1.2
        assert send(limiter, commands, -3.0) == pytest.approx(-40.0)  # 20 * -10 (1.2 - 1.0)

    @pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
    @pytest.mark.parametrize(
        "values", [{}, {"effort": 10.0, "effort_rate": 1000.0, "velocity": 1.0, "lower": -1.0, "upper": 1.0}]
    )
    def test_a_command_that_is_no_number_is_replaced_by_the_one_before(self, bad, values):
        _, commands, limiter = one(EffortLimiter, **values)
        assert send(limiter, commands, bad) == 0.0
        limiter.reset([2.0])
        assert send(limiter, commands, bad) == 2.0
        assert limiter.counts.not_finite == [2]
        assert limiter.counts.effort == [2]

    def test_a_state_that_is_no_number_holds_the_command(self):
        states, commands, limiter = one(EffortLimiter, lower=-1.0, upper=1.0, effort=10.0)
        limiter.reset([3.0])
        states.position[0] = math.nan
        assert send(limiter, commands, 9.0) == 3.0

    def test_speed_and_excess_are_remembered_at_their_largest(self):
        states, commands, limiter = one(EffortLimiter, lower=-1.0, upper=1.0, velocity=2.0, effort=10.0)
        for q, v in ((0.0, 1.0), (1.25, -3.0), (1.1, 0.5)):
            states.position[0], states.velocity[0] = q, v
            send(limiter, commands, 0.0)
        assert limiter.counts.velocity_ratio_max == [1.5]
        assert limiter.counts.position_excess_max == [0.25]

    def test_clearing_the_counts_begins_a_new_run_with_the_same_limiter(self):
        states, commands, limiter = one(EffortLimiter, lower=-1.0, upper=1.0, velocity=2.0, effort=10.0)
        states.position[0], states.velocity[0] = 1.5, 1.8
        send(limiter, commands, 50.0)
        assert limiter.counts.started_outside == [True]
        limiter.counts.clear()
        states.position[0], states.velocity[0] = 0.0, 0.5
        send(limiter, commands, 1.0)
        assert limiter.counts.started_outside == [False]
        assert limiter.counts.velocity_ratio_max == [0.25]
        assert limiter.counts.cycles == 1

    def test_a_start_outside_the_range_is_said_once_with_joint_value_and_range(self, caplog):
        states, _, limiter = make(
            EffortLimiter, JointLimits("j3", lower=-1.0, upper=1.0), JointLimits("j4", lower=-3.0718, upper=-0.0698)
        )
        states.position[1] = 0.0
        with caplog.at_level(logging.WARNING, logger="hric"):
            for _ in range(3):
                limiter.enforce(DT)
        assert [record.getMessage() for record in caplog.records] == [
            "joint j4 starts at 0.0000 rad, outside its range [-3.0718, -0.0698]: it may only move inwards until it is "
            "inside"
        ]
        assert limiter.counts.started_outside == [False, True]

    def test_only_selected_joints_are_limited(self):
        _, commands, limiter = make(EffortLimiter, JointLimits("a", effort=1.0), JointLimits("b", effort=1.0))
        limiter.select(["b"])
        commands.value[:] = [5.0, 5.0]
        limiter.enforce(DT)
        assert commands.value == [5.0, 1.0]
        assert limiter.counts.effort == [0, 1]
        limiter.select(None)
        commands.value[:] = [5.0, 5.0]
        limiter.enforce(DT)
        assert commands.value == [1.0, 1.0]
        with pytest.raises(UnknownNameError, match="a, b"):
            limiter.select(["c"])

    def test_limits_for_other_joints_are_refused(self):
        states = JointStates(["a", "b"])
        with pytest.raises(HricError, match=r"limits are for b, a; the joints are a, b"):
            EffortLimiter(states, JointCommands(states), [JointLimits("b"), JointLimits("a")])

    def test_the_quick_test_never_changes_the_result(self):
        """Against the stages alone, over random states; the quick test may only skip work."""
        rng = random.Random(1)
        for soft in (
            {},
            {"k_velocity": 8.0},
            {"k_velocity": 8.0, "k_position": 6.0, "soft_lower": -0.9, "soft_upper": 0.8},
        ):
            values = {"lower": -1.0, "upper": 1.0, "velocity": 2.0, "effort": 9.0, "effort_rate": 4000.0, **soft}
            states, commands, limiter = one(EffortLimiter, **values)
            limit, last = limiter.limits[0], 0.0
            limiter.reset([0.0])
            for _ in range(3000):
                q, v, tau = rng.uniform(-1.3, 1.3), rng.gauss(0.0, 1.2), rng.gauss(0.0, 6.0)
                states.position[0], states.velocity[0] = q, v
                expected = limiter._velocity_stage(limit, q, v, limiter._position_stage(limit, q, v, tau))
                expected = min(max(expected, -9.0), 9.0)
                expected = min(max(expected, last - 4.0), last + 4.0)
                last = send(limiter, commands, tau)
                assert last == pytest.approx(expected, abs=1e-12)


class TestVelocity:
    def test_velocity_is_cut_to_the_limit(self):
        _, commands, limiter = one(VelocityLimiter, velocity=2.0)
        assert send(limiter, commands, 3.0) == 2.0
        assert send(limiter, commands, -3.0) == -2.0
        assert limiter.counts.velocity == [2]

    @pytest.mark.parametrize(
        ("q", "wanted", "sent"), [(1.1, 1.0, 0.0), (1.1, -1.0, -1.0), (-1.1, -1.0, 0.0), (-1.1, 1.0, 1.0)]
    )
    def test_outside_the_range_only_inward_velocity_passes(self, q, wanted, sent):
        states, commands, limiter = one(VelocityLimiter, lower=-1.0, upper=1.0, velocity=2.0)
        states.position[0] = q
        assert send(limiter, commands, wanted) == sent
        assert limiter.counts.position == [int(wanted != sent)]

    def test_the_last_step_to_the_end_of_the_range_does_not_go_beyond(self):
        states, commands, limiter = one(VelocityLimiter, lower=-1.0, upper=1.0, velocity=2.0)
        q = 0.99
        for _ in range(20):
            states.position[0] = q
            q += DT * send(limiter, commands, 2.0)
        assert q == pytest.approx(1.0, abs=1e-12)

    def test_with_an_acceleration_limit_the_joint_is_braked_in_time(self):
        states, commands, limiter = one(VelocityLimiter, lower=-1.0, upper=1.0, velocity=2.0, acceleration=10.0)
        q, v, speeds = 0.0, 0.0, []
        for _ in range(2000):
            states.position[0], states.velocity[0] = q, v
            v = send(limiter, commands, 5.0)
            q += DT * v
            speeds.append(v)
        assert max(speeds) == pytest.approx(2.0)
        assert max(abs(b - a) for a, b in zip([0.0, *speeds], speeds, strict=False)) <= 10.0 * DT + 1e-12
        assert 0.999 < q <= 1.0 + 1e-12

    def test_a_soft_range_bends_the_approach(self):
        states, commands, limiter = one(
            VelocityLimiter, lower=-1.0, upper=1.0, velocity=2.0, k_position=10.0, soft_lower=-0.9, soft_upper=0.9
        )
        states.position[0] = 0.85
        assert send(limiter, commands, 2.0) == pytest.approx(0.5)

    def test_the_first_command_is_accelerated_from_the_measured_velocity(self):
        states, commands, limiter = one(VelocityLimiter, velocity=2.0, acceleration=10.0)
        states.velocity[0] = 1.0
        assert send(limiter, commands, 2.0) == pytest.approx(1.01)

    def test_nan_is_not_passed_on(self):
        _, commands, limiter = one(VelocityLimiter, velocity=2.0)
        limiter.reset([0.5])
        assert send(limiter, commands, math.nan) == 0.5
        assert limiter.counts.velocity == [1]


class TestPosition:
    def test_position_is_cut_to_the_range(self):
        states, commands, limiter = one(PositionLimiter, lower=-1.0, upper=1.0)
        states.position[0] = 1.0
        assert send(limiter, commands, 1.5) == 1.0
        assert limiter.counts.position == [1]

    def test_the_change_per_cycle_is_limited_by_velocity_from_the_measured_position(self):
        states, commands, limiter = one(PositionLimiter, lower=-1.0, upper=1.0, velocity=2.0)
        states.position[0] = 0.5
        assert send(limiter, commands, 0.9) == pytest.approx(0.502)
        assert send(limiter, commands, 0.9) == pytest.approx(0.504)
        assert limiter.counts.velocity == [2]

    def test_a_start_outside_is_led_back_without_a_jump(self):
        states, commands, limiter = one(PositionLimiter, lower=-1.0, upper=-0.1, velocity=2.0)
        states.position[0] = 0.0
        sent = [send(limiter, commands, 0.0) for _ in range(60)]
        assert sent[0] == pytest.approx(-0.002)
        assert sent[-1] == pytest.approx(-0.1)
        assert limiter.counts.started_outside == [True]

    def test_with_an_acceleration_limit_the_command_neither_jumps_nor_overshoots(self):
        _, commands, limiter = one(PositionLimiter, lower=-1.0, upper=1.0, velocity=2.0, acceleration=10.0)
        sent = [0.0, 0.0, *(send(limiter, commands, 0.8) for _ in range(1500))]
        accelerations = [(a - 2 * b + c) / DT**2 for a, b, c in zip(sent, sent[1:], sent[2:], strict=False)]
        assert max(map(abs, accelerations)) <= 10.0 + 1e-5
        assert max(sent) <= 0.8 + 1e-12
        assert sent[-1] == pytest.approx(0.8, abs=1e-9)

    def test_a_soft_range_bends_the_approach(self):
        states, commands, limiter = one(
            PositionLimiter, lower=-1.0, upper=1.0, velocity=2.0, k_position=10.0, soft_lower=-0.9, soft_upper=0.9
        )
        states.position[0] = 0.85
        assert send(limiter, commands, 0.95) == pytest.approx(0.8505)
        for _ in range(5000):
            end = send(limiter, commands, 0.95)
        assert end == pytest.approx(0.9, abs=1e-6)

    def test_nan_is_not_passed_on(self):
        states, commands, limiter = one(PositionLimiter, lower=-1.0, upper=1.0)
        states.position[0] = 0.3
        assert send(limiter, commands, math.nan) == 0.3
        assert limiter.counts.position == [1]


@pytest.mark.parametrize("distance", [1e-7, 1e-6, 1e-3, 0.02, 0.7])
def test_from_the_stopping_speed_braking_covers_exactly_the_distance(distance):
    speed, covered = stopping_speed(distance, 5.0, DT), 0.0
    while speed > 0.0:
        covered += speed * DT
        speed -= 5.0 * DT
    assert covered == pytest.approx(distance, rel=1e-9)


def test_a_snapshot_of_the_counts_stays_as_it_was():
    _, commands, limiter = make(
        EffortLimiter, JointLimits("a", effort=1.0, velocity=8.0), JointLimits("b", velocity=1.0)
    )
    commands.value[0] = 5.0
    limiter.states.velocity[0] = 4.0
    limiter.enforce(DT)
    snapshot = limiter.counts.copy()
    limiter.enforce(DT)
    limiter.counts.clear()
    message = snapshot.message(None)
    assert (message.joint_names, message.cycles, message.effort) == (["a", "b"], 1, [1, 0])
    assert message.velocity_ratio_max == [0.5, 0.0]
