"""Contacts are searched only while there may be one, and no step shows the difference."""

import mujoco
import numpy as np
import pytest

from hric_human.body import Subject, describe

SWING = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
BALL = """<robot name="ball"><link name="ball">
  <inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  <collision><geometry><sphere radius="0.05"/></geometry></collision>
</link></robot>"""


def _searched(scene, before):
    """Return MuJoCo's own step from a state, with a search for contacts in each stage, and its data."""
    d = mujoco.MjData(scene.m)
    d.qpos[:], d.qvel[:], d.qacc_warmstart[:], d.time = before
    d.qfrc_applied[:] = scene.d.qfrc_applied
    d.xfrc_applied[:] = scene.d.xfrc_applied
    mujoco.mj_step(scene.m, d)
    return d


def _steps(plant, count, tau):
    """Step, compare with MuJoCo's own step bit by bit, and return the numbers of contacts."""
    scene, contacts = plant.world.scene, []
    for _ in range(count):
        d = scene.d
        before = d.qpos.copy(), d.qvel.copy(), d.qacc_warmstart.copy(), d.time
        plant.apply(tau)
        plant.step()
        expected = _searched(scene, before)
        assert np.array_equal(expected.qpos, d.qpos) and np.array_equal(expected.qvel, d.qvel)
        assert expected.ncon == d.ncon
        contacts.append(d.ncon)
    return contacts


def _at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def test_an_arm_that_hits_an_object_moves_as_with_a_search_in_each_stage(make_plant, panda_urdf):
    plant = make_plant(panda_urdf)
    plant.spawn("ball", BALL, _at(0.39, 0.2, 0.2), fixed=True)
    plant.reset(SWING)
    contacts = _steps(plant, 800, [0.0, 10.0, 0.0, 10.0, 0.0, 0.0, 0.0])
    assert contacts[0] == 0 and max(contacts) > 0


def test_a_person_who_is_moved_into_the_arm_is_found_at_once(make_plant, panda_urdf):
    plant = make_plant(panda_urdf)
    body = describe(Subject(code="S01", mass=75.0, height=1.75, sex="male", parts="right_arm"))
    plant.spawn("person", body.urdf, _at(0.6, 0.3, 0.3), fixed=True)
    contacts = [max(_reached(plant, q)) for q in np.linspace(-2.5, 2.5, 40)]
    assert max(contacts) > 0 and min(contacts) == 0


def _reached(plant, q):
    plant.reset([q, 0.6, 0.0, -1.8, 0.0, 2.0, 0.5])
    return _steps(plant, 3, [0.0] * 7)


@pytest.mark.parametrize("integrator", ["semi_implicit", "accurate"])
def test_a_falling_ball_is_found_before_it_touches(make_plant, panda_urdf, integrator):
    plant = make_plant(panda_urdf, q=SWING, integrator=integrator)
    plant.spawn("ball", BALL, _at(0.0, 0.0, 2.5))
    contacts = _steps(plant, 900, [0.0] * 7)
    assert contacts[0] == 0 and max(contacts) > 0
