"""Contacts of a human beside a closed form and the commanded torque: masses against a rigid-body library, and a run."""

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio
import pytest
from scipy.integrate import solve_ivp

import panda_description
from hric_bags.run_folder import RunFolder
from hric_control import urdf
from hric_control.geometry import homogeneous
from hric_control.geometry.transforms import rotation_from_rpy
from hric_experiments import cli
from hric_experiments.analysis import human, impact
from hric_experiments.analysis.impact import Mechanism, Transient
from hric_experiments.report import headline, human_figures
from hric_experiments.report_html import run_data, tables
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

ROTOR = 0.1
"""Of the robot [kg m^2]."""
WALL = "package://hric_experiments/worlds/wall_behind_arm.yaml"
FORM = Transient(0.5, 6.0, 2.0, 40e3)


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


@pytest.fixture(scope="module")
def clamped(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunFolder]:
    """The arm meets a forearm, pushes it to a wall, and goes on pushing."""
    root = tmp_path_factory.mktemp("runs")
    words = ["simulator:=mujoco", "robot.parameters.reflexes:=false", f"world:={WALL}", "human.parts:=right_arm"]
    assert cli.main(["run", "contact", *words, "--quiet", "--no-figures", "--runs", str(root)]) == 0
    yield RunFolder((root / "latest").resolve())


@pytest.fixture(scope="module")
def found(clamped: RunFolder) -> dict[str, Any]:
    metrics: dict[str, Any] = json.loads((clamped.path / "metrics.json").read_text())
    return metrics


def test_the_first_peak_of_the_experiment_is_that_of_both_reflected_masses(found: dict[str, Any]) -> None:
    by_robot = [one for one in found["human"]["contacts"] if one["transient"]]
    blow = by_robot[0]
    assert blow["regions"] == ["lower arm, wrist"] and blow["speed"] > 0.2
    form = blow["transient"]
    assert form["peak"] == pytest.approx(blow["speed"] * math.sqrt(form["mass"] * 40e3))
    assert form["measured_peak"] == blow["peak"]
    assert form["ratio"] == pytest.approx(1.0, abs=0.03)
    assert blow["duration"] == pytest.approx(form["duration"], abs=3e-3)
    assert blow["impulse"] == pytest.approx(form["impulse"], rel=0.1)


def test_a_clamped_link_carries_what_the_commanded_torque_balances(found: dict[str, Any]) -> None:
    (press,) = [one["press"] for one in found["human"]["contacts"] if one["press"]]
    assert press["force"] > 10.0 and press["ratio"] == pytest.approx(1.0, abs=0.02)


def test_what_is_expected_is_beside_what_was_found_in_text_headline_table_and_figures(
    clamped: RunFolder, found: dict[str, Any]
) -> None:
    text = human.render(found["human"])
    assert "v sqrt(mu k) = " in text and "that the commanded torque balances: ratio " in text
    assert text.count("met panda::panda_hand") == 1 and "they met " in text
    shown = {one.name: one.value for one in headline.of_run({}, found)}
    assert shown["Blow"].endswith(" N") and shown["Pressed with"].endswith(" N")
    data = run_data.load(clamped, found)
    figures = {figure.key: figure for figure in human_figures.human_figures(data.person)}
    blow, press = figures["blow"].panels[0], figures["press"].panels[0]
    expected, simulated = blow.curves
    ((_, peak),) = blow.bounds
    assert expected.values.max() == pytest.approx(peak, rel=1e-3)
    at = np.interp(simulated.time, expected.time, expected.values)
    rising = simulated.time < 0.5e3 * found["human"]["contacts"][0]["transient"]["duration"]
    assert rising.sum() > 4  # of 13 ms; then both have turned
    assert np.abs(simulated.values - at)[rising].max() < 0.02 * peak
    assert not figures["blow"].timed and figures["press"].timed
    assert figures["blow"].horizontal_range(blow) == (0.0, simulated.time[-1])
    balanced, contact = press.curves
    assert contact.values[-50:] == pytest.approx(balanced.values[-50:], rel=0.05)
    rows = tables.blows_table(found["human"]["contacts"]).rows
    assert len(rows) == sum(one["transient"] is not None for one in found["human"]["contacts"])


def test_a_run_whose_world_file_is_gone_tells_its_contacts_without_a_closed_form(clamped: RunFolder) -> None:
    run, record = clamped.read(), run_data.load(clamped, {"human": {}}).record
    run["parameters"]["robot"]["plant"]["world"] = "nowhere.yaml"
    person = run_data.load(clamped, {"human": {}}).person
    assert person is not None
    found = impact.impacts(run, clamped.description(), record, person.record)
    assert len(found) == len(person.impacts) and not any(one.transient or one.press for one in found)
