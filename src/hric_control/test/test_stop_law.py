"""Stops of spawned models: a spring and a damper that follow from what hangs on the joint."""

import math

import pytest

from hric_control.plants import StopLaw
from hric_control.plants.stops import STOP_RATE
from hric_control.urdf import read

ROD = """<robot name="rod">
  <link name="base"/>
  <link name="upper"/>
  <link name="rod"><inertial><origin xyz="0 0 -0.2"/><mass value="2"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.001"/></inertial></link>
  <joint name="swing" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="0.5" effort="10" velocity="5"/></joint>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="rod"/><origin xyz="0 0 -0.1"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="0.1" effort="10" velocity="5"/></joint>
</robot>"""
INERTIA = 0.03 + 2.0 * 0.3**2
"""About the axis of the swing [kg m^2]."""


@pytest.fixture
def law() -> StopLaw:
    law = StopLaw(read(ROD), ["swing", "slide"])
    law.restart([0.0, 0.05])
    return law


def test_within_the_range_nothing_is_added(law: StopLaw) -> None:
    assert law.add([0.5, 0.1], [9.0, 9.0], [1.0, 2.0]) == [1.0, 2.0]


def test_beyond_an_end_the_joint_is_a_critically_damped_oscillator_of_what_hangs_on_it(law: StopLaw) -> None:
    swing, slide = law.add([0.51, -0.002], [0.01, 0.0], [1.0, 0.0])
    assert swing == pytest.approx(1.0 - INERTIA * (STOP_RATE**2 * 0.01 + 2.0 * STOP_RATE * 0.01))
    assert slide == pytest.approx(2.0 * STOP_RATE**2 * 0.002)


def test_a_stop_never_holds_a_joint_that_leaves_it(law: StopLaw) -> None:
    assert law.add([0.5001, 0.05], [-5.0, 0.0], [0.0, 0.0]) == [0.0, 0.0]


def test_a_joint_that_starts_outside_is_free_until_it_has_been_inside(law: StopLaw) -> None:
    law.restart([0.6, 0.05])
    assert law.add([0.6, 0.05], [0.0, 0.0], [0.0, 0.0]) == [0.0, 0.0]
    law.add([0.4, 0.05], [0.0, 0.0], [0.0, 0.0])
    assert law.add([0.6, 0.05], [0.0, 0.0], [0.0, 0.0])[0] < 0.0


def test_held_over_steps_of_a_millisecond_a_blow_on_the_stop_dies_out_without_another_one(law: StopLaw) -> None:
    q, dq, deepest = 0.49, 2.0, 0.0
    for _ in range(200):
        (effort, _) = law.add([q, 0.05], [dq, 0.0], [0.0, 0.0])
        dq += 1e-3 * effort / INERTIA
        q += 1e-3 * dq
        deepest = max(deepest, q - 0.5)
    assert deepest < 2.0 / STOP_RATE and dq <= 0.0 and math.isfinite(q)
