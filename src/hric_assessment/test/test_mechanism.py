"""Contacts beside a closed form and the commanded torque: masses against a rigid-body library, motion against an
integrator."""

from typing import Any

import numpy as np
import pinocchio
import pytest
from scipy.integrate import solve_ivp

import panda_description
from hric_assessment.contact.impact import ClosedFormImpact
from hric_assessment.contact.mass import ROBOT_MASSES, Mechanism, RobotMasses
from hric_core import urdf
from hric_core.geometry import MassProperties, homogeneous
from hric_core.geometry.transforms import inverse, rotation_from_rpy
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

ROTOR = 0.1
"""Rotor inertia of the robot's joints [kg m^2]."""
FORM = ClosedFormImpact(0.5, 6.0, 2.0, 40e3)


class Library:
    """Robot or human in pinocchio, with its root anywhere; the same joints as a mechanism."""

    def __init__(self, description: str, joints: tuple[str, ...], rotor: float, T_world_root: Any) -> None:
        self._model = model = pinocchio.buildModelFromXML(description)
        locked = [model.getJointId(name) for name in list(model.names)[1:] if name not in joints]
        self._model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
        self._data, self._T, self._rotor = self._model.createData(), T_world_root, rotor
        self._columns = [self._model.joints[self._model.getJointId(name)].idx_v for name in joints]

    def row(self, q: Any, link: str, p_link: Any, normal: Any) -> tuple[Any, Any, Any]:
        """(point in the world, n' J, M + B) of a point of a link."""
        x = np.empty(len(self._columns))
        x[self._columns] = q
        frame, world = self._model.getFrameId(link), pinocchio.LOCAL_WORLD_ALIGNED
        J = pinocchio.computeFrameJacobian(self._model, self._data, x, frame, world)[:, self._columns]
        pinocchio.framesForwardKinematics(self._model, self._data, x)
        placed = self._data.oMf[frame]
        lever, n = placed.rotation @ p_link, self._T[:3, :3].T @ normal
        M = np.triu(pinocchio.crba(self._model, self._data, x))
        M = (M + np.triu(M, 1).T)[np.ix_(self._columns, self._columns)] + self._rotor * np.eye(len(self._columns))
        point = self._T[:3, :3] @ (placed.translation + lever) + self._T[:3, 3]
        return point, n @ J[:3] + np.cross(lever, n) @ J[3:], M

    def locked_mass(self, q: Any, point: Any, normal: Any) -> float:
        """Mass of all moving bodies together, as one free body, at a point of the world along a normal [kg]."""
        x = np.empty(len(self._columns))
        x[self._columns] = q
        pinocchio.ccrba(self._model, self._data, x, np.zeros(len(x)))
        body, lever = self._data.Ig, np.cross(point - self._data.com[0], normal)
        return float(1.0 / (1.0 / body.mass + lever @ np.linalg.solve(body.inertia, lever)))


def arm() -> tuple[Mechanism, Library, str]:
    description = panda_description.load(hand=True)
    joints, T = tuple(f"panda_joint{k}" for k in range(1, 8)), np.eye(4)
    return Mechanism(urdf.read(description), joints, [ROTOR] * 7), Library(description, joints, ROTOR, T), "panda_hand"


def person() -> tuple[Mechanism, Library, str]:
    body = describe(HumanSettings.of({"parts": "upper_body"}, "human").person)
    T, joints = homogeneous(rotation_from_rpy((0.1, -0.2, 2.5)), (0.9, -0.3, 0.2)), tuple(body.joints)
    mechanism = Mechanism(urdf.read(body.urdf), joints, [0.0] * len(joints), T)
    return mechanism, Library(body.urdf, joints, 0.0, T), "r_elbow"


@pytest.mark.parametrize("make", [arm, person])
def test_the_reflected_mass_is_that_of_a_rigid_body_library(make: Any) -> None:
    mechanism, library, link = make()
    random = np.random.default_rng(3)
    for _ in range(5):
        q, p_link, n = (random.normal(0.0, s, m) for s, m in ((0.5, len(mechanism.joints)), (0.1, 3), (1.0, 3)))
        n /= np.linalg.norm(n)
        point, row, M = library.row(q, link, p_link, n)
        expected = 1.0 / (row @ np.linalg.solve(M, row))
        assert mechanism.reflected_mass(q, link, point, n) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("inertials", ["barycentric", "fr3"])
def test_the_locked_mass_is_that_of_a_library(inertials: str) -> None:
    description, joints = panda_description.load(inertials=inertials), tuple(f"panda_joint{k}" for k in range(1, 8))
    mechanism = Mechanism(urdf.read(description), joints, panda_description.rotor_inertia())
    library, random = Library(description, joints, 0.0, np.eye(4)), np.random.default_rng(4)
    for _ in range(5):
        q, point, n = (random.normal(0.0, s, m) for s, m in ((0.5, 7), (0.5, 3), (1.0, 3)))
        n /= np.linalg.norm(n)
        assert mechanism.locked_mass(q, point, n) == pytest.approx(library.locked_mass(q, point, n), rel=1e-9)


def test_the_locked_mass_depends_on_the_lever_alone() -> None:
    mechanism, _, _ = arm()
    q = np.linspace(-1.0, 1.0, 7)
    far = [mechanism.locked_mass(q, (0.0, 0.0, z), (0.0, 0.0, 1.0)) for z in (0.3, 0.9)]
    assert far[0] == pytest.approx(far[1], rel=1e-12)


def test_the_standard_counts_tool_and_load_fully() -> None:
    mechanism, _, link = arm()
    masses = mechanism.robot_masses(np.zeros(7), link, (0.1, 0.0, 0.9), (1.0, 0.0, 0.0), load=2.0)
    links = sum(panda_description.inertials()[f"link{k}"].mass for k in range(1, 8))
    assert masses.standard == pytest.approx(0.5 * links + 0.73 + 2 * 0.015 + 2.0)


def test_a_payload_weighs_as_the_same_body_in_the_description() -> None:
    with_hand, bare = (urdf.read(panda_description.load(hand=hand)) for hand in (True, False))
    joints, q, point, normal = arm()[0].joints, np.linspace(-1.0, 1.0, 7), (0.4, 0.1, 0.5), (0.6, 0.0, 0.8)
    hand = MassProperties()
    for name in ("panda_hand", "panda_leftfinger", "panda_rightfinger"):
        T_link8_part = inverse(with_hand.poses({})["panda_link8"]) @ with_hand.poses({})[name]
        part = with_hand.links[name].mass
        assert part is not None
        hand += part.moved(T_link8_part)
    described, carried = (
        Mechanism(tree, joints, [ROTOR] * 7, payloads=payload).robot_masses(q, "panda_link7", point, normal, load)
        for tree, payload, load in ((with_hand, {}, 0.0), (bare, {"panda_link8": hand}, hand.mass))
    )
    assert carried == pytest.approx(described, rel=1e-9)


@pytest.mark.parametrize(("which", "mass"), list(zip(ROBOT_MASSES, (4.0, 2.0, 3.0, 4.0), strict=True)))
def test_a_contact_is_judged_by_the_chosen_mass(which: str, mass: float) -> None:
    assert RobotMasses(2.0, 3.0, 4.0).judged(which) == mass


def test_an_unknown_mass_is_not_overlooked() -> None:
    assert np.isnan(RobotMasses(2.0, 3.0, float("nan")).judged())


def test_joints_may_come_in_any_order() -> None:
    mechanism, _, link = arm()
    turned = Mechanism(mechanism.tree, mechanism.joints[::-1], [ROTOR] * 7)
    q, point, normal = np.linspace(-1.0, 1.0, 7), (0.4, 0.1, 0.5), (0.6, 0.0, 0.8)
    assert turned.reflected_mass(q[::-1], link, point, normal) == pytest.approx(
        mechanism.reflected_mass(q, link, point, normal)
    )


def test_a_torque_that_presses_at_a_point_balances_the_force_it_was_made_of() -> None:
    mechanism, library, link = arm()
    q, p_link = np.array([0.3, -0.7, 0.2, -2.2, 0.1, 1.4, 0.5]), np.array([0.0, 0.02, 0.05])
    force = np.array([60.0, -20.0, 5.0])
    tau = np.zeros(7)
    for axis, component in zip(np.eye(3), force, strict=True):
        point, row, _ = library.row(q, link, p_link, axis)
        tau += component * row
    normal = np.array([0.8, 0.6, 0.0])
    assert mechanism.balanced(q, link, point, normal, tau) == pytest.approx(normal @ force, rel=1e-9)


def test_the_closed_form_is_what_two_masses_do_on_a_spring() -> None:
    form = FORM

    def motion(_: float, x: Any) -> list[float]:
        load = form.stiffness * max(x[0] - x[1], 0.0)
        return [x[2], x[3], -load / form.robot_mass, load / form.human_mass]

    time = np.linspace(0.0, form.duration, 2001)
    x = solve_ivp(motion, (0.0, form.duration), [0.0, 0.0, form.speed, 0.0], t_eval=time, rtol=1e-10, atol=1e-12).y
    load = form.stiffness * (x[0] - x[1])
    np.testing.assert_allclose(form.force(time), load, atol=1e-4 * form.peak)
    assert load.max() == pytest.approx(form.peak, rel=1e-6) and load[-1] == pytest.approx(0.0, abs=1e-4 * form.peak)
    assert form.human_mass * x[3, -1] == pytest.approx(form.impulse, rel=1e-6)


def test_the_closed_form_has_no_force_before_the_touch_and_after_the_parting() -> None:
    assert FORM.force(np.array([-0.5, -1e-3, 1.001, 1.5]) * FORM.duration).tolist() == [0.0] * 4


def test_a_link_that_no_joint_moves_has_an_infinite_reflected_mass() -> None:
    mechanism, _, _ = arm()
    assert mechanism.reflected_mass(np.zeros(7), "panda_link0", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0)) == np.inf
