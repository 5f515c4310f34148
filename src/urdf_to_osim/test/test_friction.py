"""Friction is as steep as the integrator allows, and no steeper."""

import math
import time

import numpy as np
import opensim
import pytest
from random_robots import tree
from small_robots import BODY, joint, link, one_joint, robot

from hric_core.geometry import FloatArray
from hric_core.urdf import Joint, Limit, read
from hric_dynamics.tree import Tree
from urdf_to_osim import Options, convert
from urdf_to_osim.friction import transition_velocity
from urdf_to_osim.min_inertias import min_inertias, poses
from urdf_to_osim.proof.oracle import Oracle

LIGHT = (
    '<inertial><origin xyz="0.03 0 0"/><mass value="0.2"/><inertia ixx="3e-4" ixy="0" ixz="0" iyy="3e-4" '
    'iyz="0" izz="3e-4"/></inertial>'
)


def limits(velocity: str = "3", dynamics: str = 'friction="1"') -> str:
    return f'<limit lower="-2" upper="2" effort="30" velocity="{velocity}"/><dynamics {dynamics}/>'


def arm(dynamics: str = 'friction="1"') -> str:
    """Two heavy links, and a light one at the end, as wrists and grippers are."""
    turn, shift = '<axis xyz="0 1 0"/>', '<origin xyz="0 0 0.3"/>'
    return robot(
        link("base", ""),
        *(link(name, BODY) for name in ("upper", "lower")),
        link("tip", LIGHT),
        joint("shoulder", "revolute", "base", "upper", limits(dynamics=dynamics) + turn),
        joint("elbow", "revolute", "upper", "lower", limits(dynamics=dynamics) + turn + shift),
        joint("wrist", "revolute", "lower", "tip", limits(dynamics=dynamics) + turn + shift),
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_mass_matrix_is_that_of_a_rigid_body_library(seed: int) -> None:
    conversion = convert(tree(seed))
    oracle, described = Oracle(conversion.plan, tree(seed), (0.0, 0.0, -9.81), "y"), conversion.plan.robot
    known = Tree(described)
    assert list(dict.fromkeys(known.joints)) == [joint.name for joint in oracle.joints]
    for q in poses(described):
        x = known.positions(q)
        assert pytest.approx(oracle.mass(np.array(x)), rel=1e-12, abs=1e-12) == known.mass_matrix(x)


def test_what_resists_a_joint_is_what_an_effort_at_it_accelerates() -> None:
    described = read(arm())
    found: list[FloatArray] = []
    for q in poses(described):
        M = Tree(described).mass_matrix(list(q.values()))
        found.append(np.array([1.0 / np.linalg.solve(M, effort)[i] for i, effort in enumerate(np.eye(3))]))
    assert list(min_inertias(described).values()) == pytest.approx(np.min(found, axis=0))


def test_friction_brings_a_slow_free_joint_to_rest_within_a_stated_time() -> None:
    heavy = Joint("a", "revolute", "b", "c", np.eye(4), np.array([0.0, 0.0, 1.0]), Limit(velocity=3.0), friction=2.0)
    assert transition_velocity(heavy, 0.1) == pytest.approx(0.002 * 2.0 / 0.1)
    assert transition_velocity(heavy, 1e6) == pytest.approx(0.03), "a hundredth of the velocity limit"
    assert transition_velocity(heavy, math.inf) == pytest.approx(0.03)


def test_friction_is_no_steeper_than_half_of_the_damping_that_the_description_has_anyway() -> None:
    light = Joint("a", "revolute", "b", "c", np.eye(4), np.array([0.0, 0.0, 1.0]), friction=1.0, damping=2.0)
    assert transition_velocity(light, 1e-6) == pytest.approx(1.0)


@pytest.mark.parametrize(("velocity", "share"), [("0", 0.01), ("-1", 0.01), ("5", 0.05), ("1e4", 0.1)])
def test_a_velocity_limit_that_says_nothing_is_taken_as_a_usual_one(velocity: str, share: float) -> None:
    conversion = convert(one_joint(inside=limits(velocity, 'friction="1e-6"')))
    assert conversion.plan.friction_velocities == {"swing": pytest.approx(share)}


def test_the_transition_of_each_joint_is_reported() -> None:
    conversion = convert(arm())
    (note,) = conversion.notes
    assert note.startswith("friction is -f tanh(dq/v), v [rad/s or m/s]: shoulder 0.0")
    assert f"wrist {conversion.plan.friction_velocities['wrist']:.3g}" in note
    assert convert(arm(), Options(friction="none")).notes == []


def test_a_transition_of_the_users_own_is_taken_for_all_joints() -> None:
    assert set(convert(arm(), Options(friction_velocity=0.02)).plan.friction_velocities.values()) == {0.02}


def seconds(urdf_xml: str, options: Options) -> float:
    """Processor time of 0.2 s forward from the default pose, repeated until it can be measured [s]."""
    model = convert(urdf_xml, options).model
    runs, started = 0, time.process_time()
    state = model.initSystem()
    started = time.process_time()
    while time.process_time() < started + 0.1:
        manager = opensim.Manager(model)
        manager.setWriteToStorage(False)
        manager.initialize(opensim.State(state))
        manager.integrate(0.2)
        runs += 1
    return (time.process_time() - started) / runs


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_friction_at_a_light_wrist_costs_at_most_three_times_the_model_without_and_a_fixed_transition_ten_times_as_much(
    damping: float,
) -> None:
    urdf_xml = arm(f'friction="1" damping="{damping}"')
    without = seconds(urdf_xml, Options(friction="none"))
    with_friction = seconds(urdf_xml, Options())
    fixed = seconds(urdf_xml, Options(friction_velocity=0.01))
    print(
        f"\ndamping {damping}: {with_friction / without:.1f} times, fixed transition {fixed / without:.1f} "
        "times the model without friction"
    )
    assert with_friction < 3.0 * without
    assert fixed > 10.0 * with_friction
