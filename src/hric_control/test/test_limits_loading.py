"""Reading limits from the description and from parameters."""

import math

import pytest

from hric_control.limits import JointLimits, load_limits
from hric_core.errors import DescriptionError, ParameterError, UnknownNameError
from hric_core.local.node import LocalNode

URDF = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
<joint name="arm" type="revolute"><parent link="a"/><child link="b"/>
  <limit lower="-1" upper="2" velocity="3" effort="40"/>
  <safety_controller k_position="100" k_velocity="40" soft_lower_limit="-0.9" soft_upper_limit="1.9"/></joint>
<joint name="wheel" type="continuous"><parent link="b"/><child link="c"/><limit velocity="5" effort="6"/></joint>
<joint name="slide" type="prismatic"><parent link="c"/><child link="d"/><limit upper="0.04" velocity="0.2" effort="70"/></joint>
<transmission name="t"><joint name="arm"/></transmission></robot>"""  # noqa: E501


def load(joint, parameters=None, **options):
    node = LocalNode({} if parameters is None else {"joint_limits": {joint: parameters}})
    return load_limits(URDF, node, [joint], **options)[0]


def test_the_description_gives_range_velocity_effort_and_soft_limits():
    assert load("arm") == JointLimits(
        "arm",
        lower=-1.0,
        upper=2.0,
        velocity=3.0,
        effort=40.0,
        k_position=100.0,
        k_velocity=40.0,
        soft_lower=-0.9,
        soft_upper=1.9,
    )


def test_a_continuous_joint_has_no_range_and_a_prismatic_one_is_in_metres():
    assert load("wheel") == JointLimits("wheel", velocity=5.0, effort=6.0)
    assert load("slide") == JointLimits("slide", lower=0.0, upper=0.04, velocity=0.2, effort=70.0, unit="m")


def test_parameters_go_before_the_description():
    limits = load(
        "arm",
        {
            "has_velocity_limits": True,
            "max_velocity": 1,
            "max_effort": 10.0,
            "has_effort_rate_limits": True,
            "max_effort_rate": 1000,
        },
    )
    assert (limits.velocity, limits.effort, limits.effort_rate, limits.upper) == (1.0, 10.0, 1000.0, 2.0)


def test_a_switch_set_to_false_takes_a_limit_away():
    limits = load("arm", {"has_position_limits": False, "has_soft_limits": False})
    assert (limits.lower, limits.upper, limits.k_position) == (-math.inf, math.inf, 0.0)


def test_use_keeps_only_the_named_kinds():
    limits = load("arm", {"max_acceleration": 10.0, "has_acceleration_limits": True}, use=("velocity", "acceleration"))
    assert limits == JointLimits("arm", velocity=3.0, acceleration=10.0)


def test_without_a_node_the_description_alone_counts():
    assert load_limits(URDF, None, ["wheel", "arm"])[1].upper == 2.0


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"max_velocity": -1.0}, "/max_velocity is -1.0; valid: a finite number of 0 or more [rad/s or m/s]"),
        ({"min_position": 3.0}, "limits of joint arm: lower 3 is above upper 2"),
        ({"soft_lower_limit": 5.0}, "soft_lower 5 is above soft_upper 1.9"),
        (
            {"has_effort_rate_limits": True},
            "has_effort_rate_limits is true, but max_effort_rate is not set, and the URDF",
        ),
        ({"has_velocity_limits": "yes"}, "has_velocity_limits is 'yes'; valid: true or false"),
        ({"max_effort": "much"}, "max_effort is 'much'; valid: a finite number"),
        ({"max_effort": True}, "max_effort is True; valid: a finite number"),
        ({"max_effort": math.nan}, "max_effort is nan; valid: a finite number"),
        (
            {"max_speed": 1.0},
            "no parameter 'max_speed' in /joint_limits/arm; valid: angle_wraparound, has_acceleration_limits",
        ),
        (7, " is 7; valid: a mapping with has_position_limits"),
    ],
)
def test_a_wrong_parameter_is_refused_with_its_joint_and_name(parameters, says):
    with pytest.raises(ParameterError) as caught:
        load("arm", parameters)
    assert says in str(caught.value)
    assert "/joint_limits/arm" in str(caught.value)


def test_an_unknown_joint_is_refused_with_those_that_exist():
    with pytest.raises(UnknownNameError, match="arm, slide, wheel"):
        load_limits(URDF, None, ["elbow"])


def test_an_unknown_kind_is_refused_with_those_that_exist():
    with pytest.raises(ParameterError, match="unknown kind of joint limit: speed; valid: position, velocity, effort"):
        load_limits(URDF, None, ["arm"], use=("speed",))


def test_a_limit_without_a_velocity_is_refused_with_its_joint():
    with pytest.raises(DescriptionError, match="joint arm: <limit> has no velocity"):
        load_limits(URDF.replace('velocity="3"', ""), None, ["arm"])
