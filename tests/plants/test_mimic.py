"""Mimic joints on every engine: drives, brakes, stops and forces on one joint act on both."""

import numpy as np
import pytest

from hric_control.plant import Mode
from hric_core.errors import DescriptionError

INERTIAL = """<inertial><origin xyz="0.3 0 0"/><mass value="{}"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>"""
PAIR = f"""<robot name="pair"><link name="base"/>
<link name="a">{INERTIAL.format(1.0)}</link>
<link name="b">{INERTIAL.format(0.5)}<collision><origin xyz="0.5 0 0"/><geometry><sphere radius="0.05"/></geometry>
</collision></link>
<joint name="lead" type="revolute"><axis xyz="0 1 0"/><parent link="base"/><child link="a"/>
<limit lower="-1.5" upper="1.5" effort="100" velocity="5"/></joint>
<joint name="follow" type="revolute"><origin xyz="0 0.3 0"/><axis xyz="0 1 0"/><parent link="base"/><child link="b"/>
<limit lower="-1" upper="0.4" effort="100" velocity="5"/><mimic joint="lead" multiplier="-0.5" offset="0.1"/></joint>
</robot>"""
"""Robot with two hanging arms side by side, the second at minus half the angle; positive angles lower the ends."""
MULTIPLIER, OFFSET = -0.5, 0.1
GRAVITY = 9.81
BOTH = pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])


def angle(plant, link):
    """Return the angle of an arm about y [rad]."""
    T = plant.link_state(link)[0]
    return float(np.arctan2(T[0, 2], T[0, 0]))


def gap(plant):
    """Return the deviation of the follower from its mimic law [rad]."""
    return abs(angle(plant, "b") - (MULTIPLIER * angle(plant, "a") + OFFSET))


def run(plant, steps, command):
    """Return the largest deviation from the mimic law during the motion [rad]."""
    worst = gap(plant)
    for _ in range(steps):
        plant.apply([command])
        plant.step()
        worst = max(worst, gap(plant))
    return worst


def state(plant):
    """Return position [rad], speed [rad/s] and effort [N m] of the leader."""
    q, dq, tau = [0.0], [0.0], [0.0]
    plant.read_state(q, dq, tau)
    return q[0], dq[0], tau[0]


def holding(q):
    """Return the effort of the leader that holds both arms [N m]."""
    return GRAVITY * 0.3 * -(1.0 * np.cos(q) + MULTIPLIER * 0.5 * np.cos(MULTIPLIER * q + OFFSET))


@BOTH
def test_the_follower_starts_on_its_law_also_where_its_own_range_has_ended(make_plant, integrator):
    plant = make_plant(PAIR, ["lead"], integrator=integrator, gravity=[0.0] * 3)
    for q in (0.3, 1.5, -1.5, -0.6):
        plant.reset([q])
        assert gap(plant) < 1e-6
        assert run(plant, 20, 0.2) < 1e-6


@BOTH
def test_the_stop_of_the_follower_stops_the_leader(make_plant, integrator):
    plant = make_plant(PAIR, ["lead"], q=[0.0], integrator=integrator, gravity=[0.0] * 3)
    assert run(plant, 600, -2.0) < 1e-6
    assert state(plant)[:2] == pytest.approx((-0.6, 0.0), abs=2e-3)


@BOTH
def test_a_brake_holds_both_and_carries_both(make_plant, integrator):
    plant = make_plant(PAIR, ["lead"], q=[0.2], integrator=integrator)
    plant.set_brakes([True])
    assert run(plant, 200, 0.0) < 1e-6
    q, _, tau = state(plant)
    assert q == pytest.approx(0.2, abs=1e-5)
    assert tau == pytest.approx(holding(0.2), rel=1e-3)


@BOTH
@pytest.mark.parametrize("mode", [Mode.VELOCITY, Mode.POSITION])
def test_a_drive_moves_both(make_plant, integrator, mode):
    plant = make_plant(PAIR, ["lead"], q=[0.0], integrator=integrator)
    plant.set_modes([mode])
    assert run(plant, 300, 0.5 if mode is Mode.VELOCITY else 0.3) < 1e-6
    q, dq, tau = state(plant)
    assert (q, dq) == pytest.approx((0.15, 0.5) if mode is Mode.VELOCITY else (0.3, 0.0), abs=2e-3)
    if mode is Mode.POSITION:
        assert tau == pytest.approx(holding(0.3), rel=2e-3)


def test_where_other_joints_are_locked_the_follower_still_follows(make_plant):
    plant = make_plant(PAIR, ["lead"], q=[0.0], passive_joints="locked", gravity=[0.0] * 3)
    assert run(plant, 100, 1.0) < 1e-6
    assert state(plant)[0] > 1e-3


@BOTH
@pytest.mark.parametrize("contact", ["rigid", "penalty, stiffness: 10000, damping: 100"])
def test_what_the_leader_is_given_the_follower_presses_with(make_plant, tmp_path, integrator, contact):
    """Check virtual work: the motion of the ball per angle of the leader is half its lever of 0.5 m."""
    (tmp_path / "world.yaml").write_text(
        "objects:\n- {name: wall, shape: box, size: [0.4, 0.4, 0.1], pose: {xyz: [0.5, 0.3, -0.1]}, "
        f"friction: 0.0, contact: {contact}}}\n"
    )
    plant = make_plant(
        PAIR, ["lead"], q=[0.202], world=str(tmp_path / "world.yaml"), integrator=integrator, gravity=[0.0] * 3
    )
    assert run(plant, 400, -1.0) < 1e-6
    forces = [(entry.force * entry.normal[2], entry.position[0]) for entry in plant.contacts()]
    moment = sum(abs(force) * x for force, x in forces)
    assert 0.5 * moment == pytest.approx(1.0, rel=1e-2)


def test_the_mass_matrix_has_both(make_plant):
    plant = make_plant(PAIR, ["lead"], q=[0.2])
    assert plant.mass_matrix() == pytest.approx(np.array([[0.01 + 0.09 + 0.25 * (0.01 + 0.045)]]))


@pytest.mark.parametrize("fixed", [True, False])
def test_a_model_beside_the_robot_has_its_laws_too(make_plant, panda_urdf, fixed):
    plant = make_plant(panda_urdf, collision=False, gravity=[0.0] * 3)
    heavy = PAIR.replace('<link name="base"/>', f'<link name="base">{INERTIAL.format(5.0)}</link>')
    T = np.eye(4)
    T[:3, 3] = 3.0, 0.0, 1.0
    plant.spawn("pair", heavy, T, fixed=fixed)
    q, dq = [0.0] * 2, [0.0] * 2
    plant.read_joints("pair", q, dq)
    assert q == pytest.approx([0.0, OFFSET], abs=1e-12)
    plant.set_joints("pair", [0.3, 0.0])
    worst = 0.0
    for effort in (1.0, -1.0, 0.0):
        plant.drive_joints("pair", [effort, 0.5])
        for _ in range(100):
            plant.apply([0.0] * 7)
            plant.step()
            plant.read_joints("pair", q, dq)
            worst = max(worst, abs(q[1] - MULTIPLIER * q[0] - OFFSET), abs(dq[1] - MULTIPLIER * dq[0]))
    assert worst < 1e-6
    assert abs(q[0] - 0.3) > 1e-2


def test_a_follower_with_a_drive_of_its_own_is_refused(make_plant):
    with pytest.raises(DescriptionError, match="joint follow: it mimics lead and cannot be driven by itself; remove"):
        make_plant(PAIR, ["lead", "follow"])
