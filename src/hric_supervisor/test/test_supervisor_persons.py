"""The supervisor's core: person data that cannot be stops the arm, and of several persons the nearest decides."""

import math

import numpy as np
import pytest
from supervisor_rig import ARM, PERIOD, READY, STILL, Cell, ball, body, shape

from hric_core.errors import ParameterError
from hric_supervisor.arm import ArmState
from hric_supervisor.decision import STOPPED, Supervisor
from hric_supervisor.person import unplaced
from hric_supervisor.settings import MODES, SupervisorSettings

OWN = SupervisorSettings()
HOLD = round(OWN.person_hold / PERIOD)


def seen_at(cell, x, **changes):
    return ball(round(cell.time + PERIOD, 9), x)._replace(**changes)


def faults(cell):
    return [event.text for decision in cell.decisions for event in decision.events if event.kind == "fault"]


def walk(cell, start, end, speed=1.5):
    """The person walks along x [m] at a speed [m/s]."""
    for x in np.arange(start, end, math.copysign(speed * PERIOD, end - start)):
        cell.decide(float(x))


@pytest.mark.parametrize("mode", MODES)
def test_a_person_who_jumps_away_stops_the_arm_until_the_data_was_valid_for_a_while(mode):
    cell = Cell(mode=mode)
    walk(cell, 3.0, 2.5)
    scales = [cell.decide(6.0).scale for _ in range(HOLD)]
    assert set(scales) == {0.0} and cell.decisions[-1].state == STOPPED
    (fault,) = faults(cell)
    assert "the person jumped: part by 3.50 m within 0.010 s; valid: 10 m/s" in fault
    for _ in range(round(OWN.hold / PERIOD) + 2):
        decision = cell.decide(6.0)
    assert decision.scale == (0.0 if mode == "hand_guided" else 1.0) and "recovered" in cell.events()


def test_a_person_who_jumps_again_is_waited_for_anew():
    cell = Cell()
    walk(cell, 3.0, 2.5)
    for k in range(5 * HOLD):
        assert cell.decide(6.0 if k // (HOLD // 2) % 2 else 3.0).scale == 0.0
    assert len(faults(cell)) == 1


@pytest.mark.parametrize("speed", [0.5, 2.0, 4.0])
def test_no_human_speed_is_a_fault_with_noise_and_with_uneven_stamps(speed):
    cell, rng = Cell(), np.random.default_rng(1)
    for k in range(300):
        x = 8.0 - speed * PERIOD * k + rng.normal(0.0, 0.005)
        cell.decide(ball(cell.time + PERIOD - rng.uniform(0.0, 0.009), x))
    assert not faults(cell)


def test_who_was_hidden_may_be_where_they_can_have_gone_meanwhile_and_no_farther():
    for gap, expected in ((0.5, False), (0.05, True)):
        cell = Cell(max_age=1.0)
        walk(cell, 4.0, 3.0)
        cell.time += gap
        assert bool(cell.decide(6.0).fault) is expected


def test_a_body_of_another_size_is_a_fault():
    cell = Cell()
    cell.decide(seen_at(cell, 3.0))
    assert cell.decide(seen_at(cell, 3.0, radii=np.array([0.05]))).scale == 0.0
    assert "the person changed size" in faults(cell)[0]
    cell, names = Cell(), list(body().joints)
    for scale in (1.0, 1.0, 0.9):
        now = round(cell.time + PERIOD, 9)
        seen = shape().seen(now, "world", dict.fromkeys(names, 0.0))
        cell.decide(seen._replace(ends=seen.ends * scale))
    assert "the person changed size" in faults(cell)[0]


def test_other_links_are_another_body():
    cell = Cell()
    cell.decide(seen_at(cell, 3.0))
    assert cell.decide(seen_at(cell, 3.0, links=("other",))).scale == 0.0 and "has other links" in faults(cell)[0]


def test_two_persons_in_one_are_a_fault_also_where_each_decision_sees_the_same_one():
    cell = Cell()
    cell.decide(3.0)
    for _ in range(20):
        between = ball(cell.time + 0.5 * PERIOD, 1.0)
        assert cell.decide(seen_at(cell, 3.0, earlier=(between,))).scale == 0.0
    assert "the person jumped" in faults(cell)[0] and len(faults(cell)) == 1


def test_what_an_input_says_is_wrong_stops_the_arm_and_is_named():
    for fault in (lambda cell: seen_at(cell, 3.0, fault="is doubled: a, b"), lambda cell: unplaced(0.02, "world", "x")):
        cell = Cell()
        cell.decide(3.0)
        assert cell.decide(fault(cell)).scale == 0.0 and "the person" in faults(cell)[0]
        assert cell.decide(3.0).scale == 0.0


@pytest.mark.parametrize(("source", "stops"), [("marker", True), ("person", True), ("human", False)])
def test_a_measured_pose_that_repeats_to_the_last_bit_is_a_tracker_that_hangs(source, stops):
    cell = Cell(source=source)
    rng = np.random.default_rng(2)
    for _ in range(20):
        cell.decide(3.5 + float(rng.normal(0.0, 1e-4)))
    before = cell.time
    scales = [cell.decide(3.5).scale for _ in range(50)]
    assert (0.0 in scales) is stops
    if stops:
        assert "the person is frozen" in faults(cell)[0]
        stopped = next(d.time for d in cell.decisions if d.scale == 0.0)
        assert stopped - before <= OWN.max_age + 2.1 * PERIOD  # stale and frozen are noticed alike


def several(*xs, **settings):
    """Return a decision of a supervisor that observes two hands; xs: their positions [m], None: not seen."""
    supervisor = Supervisor(SupervisorSettings(source="marker", body=["left", "right"], **settings), ARM)
    first, second = (None if x is None else ball(0.01, x) for x in xs)
    return supervisor.decide(0.01, ArmState(0.01, READY, STILL), first, others=[second])


def test_of_several_persons_the_nearest_decides_whoever_it_is():
    alone = Cell(source="marker").decide(1.9)
    for xs, link in (((1.9, 5.0), "left/part"), ((5.0, 1.9), "right/part")):
        decision = several(*xs)
        assert decision.scale == alone.scale < 1.0 and decision.part.person_link == link
    assert several(5.0, 5.0).scale == 1.0


@pytest.mark.parametrize("xs", [(None, 5.0), (5.0, None), (math.nan, 5.0), (5.0, math.nan)])
def test_a_fault_of_any_of_several_stops_the_arm(xs):
    decision = several(*xs)
    assert decision.scale == 0.0 and ("left" if xs[0] != 5.0 else "right") in decision.fault


def test_the_speed_of_each_of_several_persons_is_by_their_own_stamps():
    supervisor = Supervisor(SupervisorSettings(source="marker", body=["a", "b"]), ARM)
    for k in range(1, 4):
        now = k * PERIOD
        first, second = ball(now, 3.0 - 0.03 * k), ball(now - (k == 3) * 0.004, 6.0)
        decision = supervisor.decide(now, ArmState(now, READY, STILL), first, others=[second])
    assert decision.perception == second.stamp  # as old as the oldest
    way = np.array(decision.part.person_point) - decision.part.robot_point
    assert decision.part.person_speed == pytest.approx(3.0 * way[0] / np.linalg.norm(way), abs=1e-6)


def test_an_observation_without_a_shape_is_nobody():
    empty = unplaced(0.01, "world", "")
    decision = Cell().supervisor.decide(0.01, ArmState(0.01, READY, STILL), empty)
    assert decision.scale == 0.0 and "the person has no shape" in decision.fault


@pytest.mark.parametrize("source", [[], ["human", "human"], "camera", ["human", 3]])
def test_a_source_that_is_none_is_refused_with_what_is_valid(source):
    with pytest.raises(ParameterError, match="marker"):
        SupervisorSettings(source=source)


def test_whatever_is_known_a_decision_is_made():
    """No input raises; what is not finite or not there stops the arm."""
    rng = np.random.default_rng(3)
    values = (0.0, math.nan, math.inf, -1e300, 1e300, 3.0)
    for mode in MODES:
        cell = Cell(mode=mode, source="marker")
        for _ in range(300):
            x, y, stamp, angle = rng.choice(values, 4)
            person = ball(stamp if rng.random() < 0.3 else cell.time + PERIOD, x, y=y, region="hand, fingers")
            q, dq = np.full(7, angle), np.full(7, rng.choice(values))
            with np.errstate(all="ignore"):
                decision = cell.decide(None if rng.random() < 0.1 else person, dq, q)
            assert 0.0 <= decision.scale <= 1.0


def test_an_arm_that_two_nodes_publish_stands():
    cell = Cell()
    walk(cell, 3.0, 2.9)
    cell.time = round(cell.time + PERIOD, 9)
    arm = ArmState(cell.time, READY, STILL, "is doubled: /a and /b both publish joint_states")
    decision = cell.supervisor.decide(cell.time, arm, ball(cell.time, 2.9))
    assert decision.scale == 0.0 and decision.fault == "the arm is doubled: /a and /b both publish joint_states"
