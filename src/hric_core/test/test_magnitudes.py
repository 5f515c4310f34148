"""Impossible values are refused, and the message names the unit that was probably meant."""

import math
from dataclasses import dataclass
from typing import Any

import pytest

from hric_control.limits import check_start
from hric_core.errors import DescriptionError, ParameterError
from hric_core.magnitudes import MAGNITUDES
from hric_core.parameters import Parameter, Settings, listing, mapping, number, numbers, per_joint
from hric_core.urdf import read

URDF = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="turn" type="revolute"><parent link="a"/><child link="b"/>
<limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="b"/><child link="c"/>
<limit lower="0" upper="0.2" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("kind", "value", "meant"),
    [
        (number(unit="rad"), 90, "90 deg would be 1.5708 rad"),
        (number(unit="rad/s"), -57, "-57 deg/s would be -0.994838 rad/s"),
        (number(unit="m"), 850, "850 mm would be 0.85 m"),
        (number(unit="kg"), 750, "750 g would be 0.75 kg"),
        (number(unit="N m"), 87000, "87000 N mm would be 87 N m"),
        (number(unit="s"), 4000, "4000 ms would be 4 s"),
        (number(unit="m^2"), 1.0, "1 cm^2 would be 0.0001 m^2"),
        (number(unit="m", minimum=1.2, maximum=2.2), 180, "180 cm would be 1.8 m"),
        (number(unit="s", minimum=0.0, maximum=5.0), 250, "250 ms would be 0.25 s"),
        (number(unit="rad or m"), 45, "45 deg would be 0.785398 rad"),
        (numbers(2, unit="m"), [0.5, 420], "420 mm would be 0.42 m"),
        (listing(numbers(3), unit="s, m"), [[420, 0.1, 550]], "550 mm would be 0.55 m"),
        (listing(numbers(3), unit="s, m"), [[4000, 0.1, 0.2]], "4000 ms would be 4 s"),
        (mapping(number(unit="rad")), {"a": 90}, "90 deg"),
    ],
)
def test_a_value_in_another_unit_is_refused_with_that_unit(kind: Parameter, value: Any, meant: str) -> None:
    with pytest.raises(ParameterError) as error:
        kind.checked(value, "x")
    assert meant in str(error.value) and "valid: " in str(error.value)


def test_values_per_joint_are_refused_with_the_joint() -> None:
    with pytest.raises(ParameterError, match=r"q\.b is 90; .*90 deg would be 1\.5708 rad"):
        per_joint(number(unit="rad")).checked([0.0, 90], "q", ["a", "b"])


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (number(unit="s", maximum=1e6), 1e5),  # its own maximum goes before that of the unit
        (number(unit="N/m"), 1e9),
        (number(unit="rad"), -3 * math.pi),
        (number(), 1e9),
        (listing(numbers(3), unit="s, m"), [[600, 1.0, 2.0]]),
    ],
)
def test_a_value_that_can_be_is_taken(kind: Parameter, value: Any) -> None:
    kind.checked(value, "x")


def test_every_bound_is_wider_than_the_slip_that_it_catches_is_large() -> None:
    for unit, magnitude in MAGNITUDES.items():
        assert all(0.0 < size < 1.0 for size in magnitude.others.values()), unit
        assert magnitude.largest > 0.0 and magnitude.source


def test_a_mistake_of_unit_is_reported_beside_others() -> None:
    @dataclass(frozen=True)
    class Pose(Settings):
        height: float = number(unit="m")
        mass: float = number(unit="kg")

    with pytest.raises(ParameterError, match=r"height.*850 mm(.|\n)*mass.*750 g"):
        Pose.of({"height": 850, "mass": 750}, "")


def test_a_start_a_little_outside_a_range_is_taken() -> None:
    check_start(URDF, ["turn", "slide"], [2.2, -0.1], "q_start")


@pytest.mark.parametrize(
    ("q", "message"),
    [
        ([-5.0, 0.0], r"q_start/turn is -5\.0; valid: -1\.5 to 2\.5 \[rad\].*-5 deg would be -0\.0872665 rad"),
        ([0.0, 20.0], r"q_start/slide is 20\.0; valid: -0\.5 to 0\.7 \[m\].*20 mm would be 0\.02 m"),
    ],
)
def test_a_start_far_outside_a_range_is_refused_with_the_likely_unit(q: list[float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        check_start(URDF, ["turn", "slide"], q, "q_start")


JOINT = """<robot name="r"><link name="a"/><link name="b"/>
<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><limit {limit}/></joint></robot>"""


@pytest.mark.parametrize(
    ("kind", "limit", "said"),
    [
        (
            "revolute",
            'lower="-170" upper="170"',
            r"lower limit -170 is beyond 12\.57 \[rad\]; -170 deg would be -2\.96",
        ),
        ("revolute", 'lower="-4" upper="215"', "upper limit 215 .*215 deg"),
        ("revolute", 'lower="-360" upper="360"', "360 deg would be -6.283"),
        ("revolute", 'lower="0" upper="100"', "100 deg"),
        ("prismatic", 'lower="0" upper="40"', r"upper limit 40 .*40 mm would be 0\.04 m"),
    ],
)
def test_an_end_of_a_description_in_another_unit_is_refused_with_that_unit(kind: str, limit: str, said: str) -> None:
    with pytest.raises(DescriptionError, match=f"joint j: its .*{said}"):
        read(JOINT.format(kind=kind, limit=limit))


@pytest.mark.parametrize(
    ("kind", "limit"),
    [
        ("revolute", 'lower="-10" upper="10"'),
        ("revolute", 'lower="-1000" upper="1000"'),
        ("revolute", 'lower="-62.83" upper="62.83"'),
        ("revolute", 'lower="-1e16" upper="1e16" velocity="800"'),
        ("revolute", 'lower="-3.4e38" upper="2147483647"'),
        ("continuous", 'lower="-180" upper="180" velocity="838"'),
        ("prismatic", 'lower="-50" upper="50"'),
        ("revolute", 'lower="-1" upper="1" velocity="1000" effort="100000"'),
        ("revolute", 'lower="-1" upper="1" velocity="59.9" effort="1000"'),
    ],
)
def test_limits_of_public_robots_are_read_without_a_word(
    kind: str, limit: str, caplog: pytest.LogCaptureFixture
) -> None:
    read(JOINT.format(kind=kind, limit=limit))
    assert not caplog.records


@pytest.mark.parametrize(
    ("kind", "limit", "said"),
    [
        ("revolute", 'velocity="150"', "velocity 150 is taken as rad/s; 150 deg/s would be 2.61799 rad/s"),
        ("revolute", 'effort="87000"', "effort 87000 is taken as N m; 87000 N mm would be 87 N m"),
        ("revolute", 'lower="-20" upper="1"', "lower limit -20 is taken as rad; -20 deg would be -0.349066 rad"),
        ("prismatic", 'velocity="200"', "velocity 200 is taken as m/s; 200 mm/s would be 0.2 m/s"),
        ("revolute", 'velocity="150" effort="12000"', "2.61799 rad/s (and 1 more limits)"),
    ],
)
def test_a_limit_of_a_description_that_is_possible_but_probably_in_another_unit_is_doubted_once(
    kind: str, limit: str, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    read(JOINT.format(kind=kind, limit=limit if "lower" in limit else f'lower="-1" upper="1" {limit}'))
    (record,) = caplog.records
    assert said in record.getMessage() and record.levelname == "WARNING"
