"""Conformance of all engines with pinocchio, for many robot descriptions: accelerations, mimic laws and contacts.

The table of all results is docs/conformance.md, written by tests/conformance/table.py.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from conformance_measures import ENGINES, acceleration_error, contacts_at_rest, loaded, motion_error, overlapping
from conformance_robots import CHAINS, CONTACTS, MIMICS, PUBLIC, mimic, parallelogram, public, public_package

from hric_control.plant import Bushing
from hric_core.urdf import read

ACCELERATION = {"PyBullet": 1e-4, "MuJoCo": 1e-6, "OpenSim": 1e-6}
"""Allowed relative error of the acceleration."""
LAW = 1e-6
"""Allowed deviation of a joint from its mimic law [rad or m]."""
TOUCHING = ("anymal-kinova.urdf", "panda_collision.urdf", "pr2.urdf", "so100.urdf", "solo12.urdf", "z1.urdf")
"""Public robots with links that overlap if all joints are at zero, and one (with a gap of 0.1 mm) that nearly does."""


@pytest.fixture(scope="module", autouse=True)
def package(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """ROS package with the meshes of the public descriptions."""
    with public_package(tmp_path_factory.mktemp("ros")):
        yield


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.mark.parametrize("robot", [*CHAINS, *MIMICS])
def test_a_small_robot_accelerates_as_another_library_says(engine: str, robot: str) -> None:
    assert acceleration_error(engine, (CHAINS | MIMICS)[robot], 4) < ACCELERATION[engine]


@pytest.mark.parametrize("robot", PUBLIC)
def test_a_public_robot_accelerates_as_another_library_says(engine: str, robot: str) -> None:
    assert acceleration_error(engine, public(robot), 3) < ACCELERATION[engine]


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
@pytest.mark.parametrize("robot", MIMICS)
def test_a_joint_that_mimics_another_starts_and_stays_on_its_law(engine: str, robot: str, integrator: str) -> None:
    assert motion_error(engine, MIMICS[robot], 100, integrator=integrator) < LAW


@pytest.mark.parametrize("robot", ["panda_collision.urdf", "pr2.urdf"])
def test_joints_of_a_public_robot_stay_on_their_laws(engine: str, robot: str) -> None:
    assert motion_error(engine, public(robot), 5) < LAW


def test_a_cut_parallelogram_is_closed_by_laws_or_by_a_bushing_alike(engine: str) -> None:
    grips = np.eye(4), np.eye(4)
    grips[0][0, 3], grips[1][0, 3] = 0.4, 0.3
    pin = Bushing("coupler", "rocker", *grips, 2e4, 200.0, rotational_stiffness=0.0, rotational_damping=0.0)
    cut, closed = parallelogram(), parallelogram(mimic("first", -1.0), mimic("first", 1.0))
    with loaded(engine, cut, ["first", "second", "third"]) as open_chain, loaded(engine, closed, ["first"]) as laws:
        open_chain.reset([0.5, -0.5, 0.5])
        open_chain.connect("pin", pin)
        laws.reset([0.5])
        for _ in range(300):
            open_chain.apply([0.0] * 3)
            open_chain.step()
            laws.apply([0.0])
            laws.step()
        (angle,), angles = laws.engine_state()[0], open_chain.engine_state()[0]
        assert abs(angle - 0.5) > 0.5
        assert angles == pytest.approx([angle, -angle, angle], abs=5e-3)


@pytest.mark.parametrize("robot", CONTACTS)
def test_neighbours_never_touch_and_others_do(engine: str, robot: str) -> None:
    urdf, pairs = CONTACTS[robot]
    assert set(contacts_at_rest(engine, urdf)) == pairs


@pytest.mark.parametrize("robot", TOUCHING)
def test_the_same_links_of_a_public_robot_touch_on_all_engines_and_none_are_neighbours(robot: str) -> None:
    urdf = public(robot)
    found = {engine: contacts_at_rest(engine, urdf) for engine in ENGINES}
    assert not {frozenset(pair) for contacts in found.values() for pair in contacts} & read(urdf).neighbours()
    assert overlapping(found["MuJoCo"]) == overlapping(found["OpenSim"]) == overlapping(found["PyBullet"])
