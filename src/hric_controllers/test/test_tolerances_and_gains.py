from types import SimpleNamespace

import pytest

from hric_controllers.trajectory.follower import GoalTolerances, Tolerance, first_violation
from hric_controllers.trajectory.settings import JointGains
from hric_core.errors import CommandError, ParameterError

JOINTS = ["a", "b"]
DEFAULTS = GoalTolerances((Tolerance(0.1), Tolerance(0.2)), (Tolerance(0.01, 0.05), Tolerance(0.02, 0.05)), 1.0)


def item(name, position=0.0, velocity=0.0):
    return SimpleNamespace(name=name, position=position, velocity=velocity, acceleration=0.0)


def test_zero_in_a_goal_keeps_the_default_tolerance():
    assert DEFAULTS.overridden(JOINTS, [item("a")], [], 0.0) == DEFAULTS


def test_a_negative_tolerance_removes_the_limit():
    changed = DEFAULTS.overridden(JOINTS, [item("b", position=-1.0)], [], -1.0)
    assert changed.path == (Tolerance(0.1), Tolerance(0.0))
    assert changed.goal_time == -1.0


def test_a_positive_tolerance_replaces_the_default():
    assert DEFAULTS.overridden(JOINTS, [], [item("a", velocity=0.5)], 3.0).goal[0] == Tolerance(0.01, 0.5)


def test_a_tolerance_for_an_unknown_joint_is_refused_with_the_valid_names():
    with pytest.raises(CommandError, match="goal_tolerance names c; valid: a, b"):
        DEFAULTS.overridden(JOINTS, [], [item("c")], 0.0)


def test_a_violation_names_the_joint_the_error_and_the_limit():
    assert first_violation(JOINTS, DEFAULTS.path, [0.05, 0.3], [0.0, 0.0]) == "b: position error 0.3 exceeds 0.2"


def test_a_velocity_violation_is_reported_too():
    assert first_violation(JOINTS, DEFAULTS.goal, [0.0, 0.0], [0.06, 0.0]) == "a: velocity error 0.06 exceeds 0.05"


def test_no_limit_means_no_violation():
    assert first_violation(JOINTS, (Tolerance(), Tolerance()), [9.0, 9.0], [9.0, 9.0]) == ""


@pytest.mark.parametrize("value", [-1.0, float("nan"), "50", True])
def test_a_gain_that_is_no_finite_number_above_zero_is_refused_by_name(value):
    with pytest.raises(ParameterError, match="gains/a/p"):
        JointGains.of({"p": value}, "gains/a")
