"""Criterion of a diverged simulation, on every engine."""

import math
import re

import pytest
from two_link import two_link_urdf

from hric_control.plants.divergence import VELOCITY_FACTOR, DivergedError

LIMIT = 20.0
"""Velocity limit of the joints [rad/s]."""
URDF = two_link_urdf(limit=f'lower="-1e3" upper="1e3" effort="1e9" velocity="{LIMIT}"')
STILL = (0.0, 0.0, 0.0)


def test_an_actuated_joint_that_runs_away_ends_the_step_with_joint_time_and_value(make_plant) -> None:
    plant = make_plant(URDF, ["joint1", "joint2"], rotor_inertia=0.1, gravity=STILL, collision=False)
    plant.reset([0.0, 0.0])
    with pytest.raises(DivergedError) as caught:
        for _ in range(200):
            plant.apply([0.0, 5e3])
            plant.step()
    error = caught.value
    assert error.joint == "joint2" and error.quantity == "speed"
    assert VELOCITY_FACTOR * LIMIT < abs(error.value) < 1.2 * VELOCITY_FACTOR * LIMIT
    assert re.fullmatch(
        rf"the simulation diverged at {error.time:.3f} s: speed of joint2 is \S+ rad/s, beyond 2000 rad/s "
        r"\(velocity limit 20 rad/s\)",
        str(error),
    )
    assert 0.002 < error.time < 0.2


def test_a_passive_joint_that_runs_away_is_named_too(make_plant) -> None:
    plant = make_plant(URDF, ["joint1"], rotor_inertia=100.0, gravity=STILL, collision=False)
    plant.reset([0.0])
    plant.apply_wrench("link2", (0.0, 0.0, 1e6), (0.0, 0.0, 0.0), (0.3, 0.3, 0.0), 0.01)
    with pytest.raises(DivergedError, match="joint2"):
        for _ in range(20):
            plant.step()


def test_sixteen_times_the_limit_is_fast_and_no_divergence(make_plant) -> None:
    plant = make_plant(URDF, ["joint1", "joint2"], rotor_inertia=0.1, gravity=STILL, collision=False)
    plant.reset([0.0, 0.0], [0.0, 16.0 * LIMIT])
    for _ in range(20):
        plant.step()


def test_time_goes_on_over_a_reset(make_plant) -> None:
    plant = make_plant(URDF, ["joint1", "joint2"], rotor_inertia=0.1, gravity=STILL, collision=False)
    for _ in range(10):
        plant.step()
    plant.reset([0.0, 0.0])
    plant.apply([float("nan"), 0.0])
    with pytest.raises(DivergedError, match=r"diverged at 0\.01[01] s.*not finite"):
        plant.step()


def test_a_finger_that_falls_far_beyond_its_velocity_limit_has_not_diverged(make_plant) -> None:
    """Check a pendulum of 1 cm without friction: sqrt(6 g / L) = 77 rad/s at the bottom, 770 times its limit."""
    length, mass = 0.01, 0.02
    inertia = mass * length**2 / 12.0
    urdf = f"""<robot name="finger"><link name="base"/><link name="tip"><inertial><origin xyz="0 0 {length / 2}"/>
      <mass value="{mass}"/><inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>
      </inertial></link><joint name="knuckle" type="continuous"><parent link="base"/><child link="tip"/>
      <axis xyz="0 1 0"/>
      <limit effort="1" velocity="0.1"/></joint></robot>"""
    plant = make_plant(urdf, ["knuckle"], rotor_inertia=0.0, collision=False)
    plant.reset([0.1])
    q, dq, tau, fastest = [0.0], [0.0], [0.0], 0.0
    for _ in range(200):
        plant.step()
        plant.read_state(q, dq, tau)
        fastest = max(fastest, abs(dq[0]))
    assert fastest == pytest.approx(math.sqrt(6.0 * 9.81 / length), rel=0.02)
