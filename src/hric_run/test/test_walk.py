"""Walking: the root of a human body is moved along a given path, on each engine."""

import itertools

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped

from hric_core.errors import HricError
from hric_core.urdf import read
from hric_human.body import describe, load
from hric_human.participant.settings import SUBJECTS, HumanSettings
from hric_human.participant.walk import GROUND, JOINTS, Walk, WalkSettings
from hric_run.simulation import Simulation

POINTS = [[0.1, 0.0, 0.0], [1.1, -0.4, 0.3], [1.3, -0.4, 0.3]]
BODY = describe(load(SUBJECTS / "P50_male.yaml"))


def walk(heading=0.0):
    return Walk(WalkSettings.of({"points": POINTS}, ""), BODY, heading)


def test_the_way_is_from_point_to_point_with_least_jerk_and_its_velocity_is_its_derivative():
    one, times = walk(), np.linspace(-0.2, 1.5, 3401)
    rows = [(*one.path.at(t), one.path.bend(t)) for t in times]
    place, speed, acceleration = (np.array([row[k] for row in rows]) for k in range(3))
    assert place[0].tolist() == [0.0, 0.0] and place[-1].tolist() == [-0.4, 0.3]
    step = times[1] - times[0]
    assert np.gradient(place, step, axis=0) == pytest.approx(speed, abs=1e-4)
    assert np.gradient(speed, step, axis=0)[5:-5] == pytest.approx(acceleration[5:-5], abs=0.02)
    assert np.linalg.norm(speed, axis=1).max() == pytest.approx(1.875 * 0.5 / 1.0, rel=1e-4)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_its_joints_are_displacements_along_the_axes_of_the_world(heading):
    tree = read(walk(heading).urdf)
    assert tree.root == GROUND
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    for name, axis in zip(JOINTS, np.eye(2), strict=True):
        assert turn @ tree.joints[name].axis[:2] == pytest.approx(axis)


def test_against_what_is_in_the_way_the_person_pushes_no_harder_than_stated():
    one = walk()
    held = one.force(5.0, [0.6, 0.3], [0.0, 0.0])
    assert np.hypot(*held) == pytest.approx(150.0)


@pytest.mark.parametrize("points", [[], [[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]], [[-1.0, 0.0, 0.0]]])
def test_times_that_do_not_rise_are_refused(points):
    with pytest.raises(HricError, match="times must increase"):
        HumanSettings.of({"walk": {"points": points}}, "human")


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "opensim"])
def test_on_each_engine_the_person_is_where_their_way_has_them(engine):
    changes = {
        "human.walk": {"points": POINTS},
        "human.position": [2.5, 0.0],
        "human.parts": "both_arms",
        "human.control": {},
    }
    roots = []
    with Simulation("contact", simulator=engine, duration=1.5, setpoints=[], **changes) as simulation:
        simulation.node.subscribe("hric/human/root", PoseStamped, roots.append)
        simulation.run()
    rows = [(m.header.stamp.to_sec(), m.pose.position.x - 2.5, m.pose.position.y) for m in roots]
    one = walk()
    begin = 0.001  # the person is called in the second cycle
    off = [np.hypot(x - p[0], y - p[1]) for (t, x, y), p in ((row, one.path.at(row[0] - begin)[0]) for row in rows)]
    assert max(off) < 0.01 and off[-1] < 2e-3
    assert all(b[0] > a[0] for a, b in itertools.pairwise(rows))


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "opensim"])
def test_a_walking_person_is_observed_on_their_way(engine):
    changes = {"human.walk": {"points": POINTS}, "human.position": [2.5, 0.0], "human.control": {}}
    with Simulation("contact", simulator=engine, setpoints=[], **changes) as simulation:
        start = simulation.observe()
        simulation.run(1.5)
        state = simulation.observe()
    way = np.subtract(POINTS[-1][1:], POINTS[0][1:])
    np.testing.assert_allclose((state.person.T_world_root - start.person.T_world_root)[:2, 3], way, atol=0.01)
    moved = state.person.capsules.ends - start.person.capsules.ends
    assert np.abs(moved[..., :2] - way).max() < 0.1  # the arms swing a little
    assert state.separation < start.separation - 0.2
