"""The force law of a bushing against analytic solutions, and conservation of momentum and energy."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from hric_control.plant import Bushing
from hric_control.plants import BushingLaw, Bushings, LinkMotion
from hric_core.errors import HricError
from hric_core.geometry import quaternions
from hric_core.geometry.transforms import rotation_from_rpy

LOOSE = Bushing("a", "m::b", np.eye(4), np.eye(4))


def moving(
    position: Sequence[float] = (0.0, 0.0, 0.0),
    turn: Sequence[float] = (0.0, 0.0, 0.0),
    linear: Sequence[float] = (0.0, 0.0, 0.0),
    angular: Sequence[float] = (0.0, 0.0, 0.0),
) -> LinkMotion:
    return LinkMotion(tuple(position), quaternions.from_rotation_vector(turn), tuple(linear), tuple(angular))


def test_it_pulls_both_bodies_together_by_stiffness_times_stretch_and_damping_times_speed() -> None:
    load = BushingLaw(LOOSE).step(moving(), moving((0.001, 0.0, 0.0), linear=(0.0, 0.02, 0.0)))
    assert load.force == pytest.approx((10.0, 2.0, 0.0)) and load.torque == (0.0, 0.0, 0.0)
    assert load.point == (0.001, 0.0, 0.0) and load.stretch == pytest.approx(0.001)


def test_it_turns_them_by_stiffness_times_the_rotation_vector_between_them() -> None:
    tool, hand = (0.3, -0.2, 0.5), (0.3, -0.2, 0.5)
    relative = np.array([0.02, 0.05, -0.03])
    b = quaternions.product(quaternions.from_rotation_vector(relative), quaternions.from_rotation_vector(tool))
    load = BushingLaw(LOOSE).step(
        moving(turn=hand, angular=(0.1, 0.0, 0.0)), moving(angular=(0.5, 0.0, 0.0))._replace(orientation=b)
    )
    assert load.torque == pytest.approx(50.0 * relative + [0.25 * 0.4, 0.0, 0.0])


def test_the_dampers_only_take_energy() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        T_a, T_b = np.eye(4), np.eye(4)
        T_a[:3, :3], T_b[:3, :3] = rotation_from_rpy(rng.uniform(-1, 1, 3)), rotation_from_rpy(rng.uniform(-1, 1, 3))
        T_a[:3, 3], T_b[:3, 3] = rng.uniform(-0.3, 0.3, (2, 3))
        a, b = (moving(*rng.uniform(-0.5, 0.5, (4, 3)).tolist()) for _ in range(2))
        damper = replace(LOOSE, T_a_grip=T_a, T_b_grip=T_b, stiffness=0.0, rotational_stiffness=0.0)
        load = BushingLaw(damper).step(a, b)
        power = sum(
            sign
            * (
                np.dot(load.force, np.add(body.linear, np.cross(body.angular, np.subtract(load.point, body.position))))
                + np.dot(load.torque, body.angular)
            )
            for sign, body in ((1.0, a), (-1.0, b))
        )
        assert power <= 0.0


def test_the_spring_has_a_potential() -> None:
    """Work along a path of both bodies is the difference of k s^2 / 2 and k phi^2 / 2."""
    rng, T_a = np.random.default_rng(0), np.eye(4)
    T_a[:3, 3] = (0.1, 0.0, 0.05)
    spring = replace(LOOSE, T_a_grip=T_a, damping=0.0, rotational_damping=0.0)
    law, step, work = BushingLaw(spring), 1e-4, 0.0
    start, rates = rng.uniform(-0.1, 0.1, (4, 3)), rng.uniform(-0.5, 0.5, (4, 3))

    def bodies(t: float) -> tuple[LinkMotion, LinkMotion]:
        (p_a, r_a, p_b, r_b), (v_a, w_a, v_b, w_b) = start, rates
        turned = [
            quaternions.product(quaternions.from_rotation_vector(w * t), quaternions.from_rotation_vector(r))
            for r, w in ((r_a, w_a), (r_b, w_b))
        ]
        return (
            LinkMotion(tuple(p_a + t * v_a), turned[0], tuple(v_a), tuple(w_a)),
            LinkMotion(tuple(p_b + t * v_b), turned[1], tuple(v_b), tuple(w_b)),
        )

    def energy(t: float) -> float:
        load = law.step(*bodies(t))
        return 0.5 * load.stretch**2 * 1e4 + 0.5 * np.dot(load.torque, load.torque) / 50.0

    for k in range(2000):
        a, b = bodies((k + 0.5) * step)
        load = law.step(a, b)
        for sign, body in ((1.0, a), (-1.0, b)):
            lever = np.subtract(load.point, body.position)
            work += sign * step * np.dot(load.force, np.add(body.linear, np.cross(body.angular, lever)))
            work += sign * step * np.dot(load.torque, body.angular)
    assert work == pytest.approx(energy(0.0) - energy(2000 * step), rel=1e-5)


def test_beyond_its_limit_it_slips_holds_the_limit_and_stays_where_it_slipped_to() -> None:
    law = BushingLaw(replace(LOOSE, force_limit=20.0))
    for x in np.linspace(0.0, 0.005, 50):
        load = law.step(moving(), moving((x, 0.0, 0.0)))
    assert math.hypot(*load.force) == pytest.approx(20.0) and load.slipped == pytest.approx(0.003)
    back = law.step(moving(), moving((0.003, 0.0, 0.0)))
    assert back.force == pytest.approx((0.0, 0.0, 0.0), abs=1e-9) and back.slipped == load.slipped


def test_beyond_its_torque_limit_it_turns() -> None:
    law = BushingLaw(replace(LOOSE, torque_limit=2.0))
    for x in np.linspace(0.0, 0.1, 50):
        load = law.step(moving(turn=(0.2, 0.1, 0.0)), moving()._replace(orientation=turned_by(x)))
    assert math.hypot(*load.torque) == pytest.approx(2.0) and load.turned == pytest.approx(0.06, rel=1e-6)


def turned_by(x: float) -> quaternions.Quaternion:
    return quaternions.product(
        quaternions.from_rotation_vector((0.0, 0.0, x)), quaternions.from_rotation_vector((0.2, 0.1, 0.0))
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"body_b": "a"}, "both bodies are a"),
        ({"T_a_grip": np.zeros((4, 4))}, "T_a_grip must be a 4 x 4 transform"),
        ({"stiffness": -1.0}, "stiffness must be a finite number of 0 or more; got -1.0"),
        ({"torque_limit": 0.0}, "torque_limit must be above 0; got 0.0"),
    ],
)
def test_what_is_no_bushing_is_refused_by_name(change: dict[str, object], message: str) -> None:
    bushings = Bushings(lambda body: body, lambda body: [body])
    with pytest.raises(HricError, match=f"connection grip: {message}"):
        bushings.connect("grip", replace(LOOSE, **change))
    assert not bushings.laws


def test_names_are_taken_once_and_unknown_ones_are_refused_with_those_that_exist() -> None:
    bushings = Bushings(lambda body: body, lambda body: [body])
    bushings.connect("grip", LOOSE)
    with pytest.raises(HricError, match="connection name 'grip' is empty or taken"):
        bushings.connect("grip", LOOSE)
    with pytest.raises(HricError, match="no connection 'grib' in the plant; valid: grip"):
        bushings.disconnect("grib")
    bushings.forget_model("m")
    assert not bushings.laws
