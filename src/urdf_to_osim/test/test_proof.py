"""The proof fails if the model file differs from the description."""

import re
from pathlib import Path

import pytest
from small_robots import LIMIT, gripper, joint, link, one_joint, robot

import panda_description
from hric_core.errors import DescriptionError
from urdf_to_osim import Options, convert, prove, write
from urdf_to_osim.proof.forward import ENOUGH

LOSSES = f'{LIMIT}<dynamics damping="0.7" friction="1.5"/><axis xyz="0 1 0"/>'


def altered(path: Path, pattern: str, replacement: str) -> None:
    text = path.read_text()
    changed, count = re.subn(pattern, replacement, text, count=1)
    assert count == 1 and changed != text, f"nothing to alter: {pattern}"
    path.write_text(changed)


@pytest.mark.parametrize(("hand", "fingers"), [(False, "fixed"), (True, "fixed"), (True, "prismatic")])
def test_the_panda_converts_with_proof_far_below_the_tolerance(hand: bool, fingers: str, tmp_path: Path) -> None:
    urdf_xml = panda_description.load(hand=hand, fingers=fingers, damping=0.003, friction="identified")
    options = Options(friction="sigmoid", friction_parameters=panda_description.friction_parameters())
    path = write(convert(urdf_xml, options), tmp_path / "panda.osim").path
    proof = prove(path, urdf_xml, options, states=50)
    assert proof.passed and max(proof.errors.values()) < 1e-12, proof.table()


@pytest.mark.parametrize(
    ("pattern", "replacement", "failing"),
    [
        (r"<mass>2</mass>", "<mass>2.00001</mass>", "mass matrix"),
        (r"<mass_center>0\.1\S* ", "<mass_center>0.1001 ", "gravity"),
        (r"<translation>0 0 0</translation>", "<translation>0 0 1e-8</translation>", "frames"),
        (r"<viscosity>0\.69\S*<", "<viscosity>40.1<", "damping"),
        (r"-1\.5\*tanh", "-1.6*tanh", "friction"),
        (r"qdot/0\.01", "qdot/0.57", "friction"),
        (r"<upper_limit>114\S*<", "<upper_limit>2<", "stops"),
        (r"<upper_stiffness>17\S*<", "<upper_stiffness>1000<", "stops"),
        (r"<damping>0\.17\S*<", "<damping>10<", "stops"),
        (r"<max_control>30<", "<max_control>31<", "effort limits"),
        (r"<optimal_force>1<", "<optimal_force>2<", "actuators"),
    ],
)
def test_a_file_that_was_altered_fails_the_proof(pattern: str, replacement: str, failing: str, tmp_path: Path) -> None:
    urdf_xml = one_joint(inside=LOSSES)
    path = write(convert(urdf_xml), tmp_path / "a.osim").path
    assert prove(path, urdf_xml, states=10).passed
    altered(path, pattern, replacement)
    proof = prove(path, urdf_xml, states=10)
    assert not proof.passed and failing in proof.failed, proof.table()


def test_a_coupler_that_was_altered_fails_the_proof(tmp_path: Path) -> None:
    path = write(convert(gripper()), tmp_path / "a.osim").path
    assert prove(path, gripper(), states=5).passed
    altered(path, r"<coefficients>-2 ", "<coefficients>-2.0001 ")
    assert prove(path, gripper(), states=5).failed == ["couplers"]


def test_a_force_that_is_missing_fails_the_proof(tmp_path: Path) -> None:
    urdf_xml = one_joint(inside=LOSSES)
    path = write(convert(urdf_xml, Options(damping=False)), tmp_path / "a.osim").path
    assert prove(path, urdf_xml, states=5).failed == ["damping"]


def test_an_error_that_is_small_only_because_the_robot_is_small_fails_the_proof(tmp_path: Path) -> None:
    body = (
        '<inertial><mass value="1e-6"/><inertia ixx="1e-10" ixy="0" ixz="0" iyy="1e-10" iyz="0" '
        'izz="1e-10"/></inertial>'
    )
    urdf_xml = one_joint(child=body)
    path = write(convert(urdf_xml), tmp_path / "a.osim").path
    altered(path, r"<inertia>1\S* ", "<inertia>2e-10 ")
    assert prove(path, urdf_xml, states=5).failed == ["mass matrix / inertia"]


def test_a_robot_without_a_moving_joint_is_proved_by_its_frames(tmp_path: Path) -> None:
    urdf_xml = robot(link("a"), link("b"), joint("j", "fixed", "a", "b", '<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/>'))
    proof = prove(write(convert(urdf_xml), tmp_path / "a.osim").path, urdf_xml)
    assert proof.passed and set(proof.errors) == {"frames"}


def test_joints_between_which_nothing_has_inertia_are_refused_by_name(tmp_path: Path) -> None:
    urdf_xml = robot(
        link("a"), link("b", ""), link("c"), joint("first", "revolute", "a", "b"), joint("second", "revolute", "b", "c")
    )
    path = write(convert(urdf_xml), tmp_path / "a.osim").path
    with pytest.raises(DescriptionError, match="joints first, second can move together without moving any inertia"):
        prove(path, urdf_xml)


@pytest.mark.parametrize("limits", ['lower="-1e16" upper="1e16"', 'lower="-1e16" upper="1"', 'lower="0.5" upper="0.5"'])
def test_ranges_without_an_end_and_without_a_width_are_proved(limits: str, tmp_path: Path) -> None:
    urdf_xml = one_joint(inside=f'<limit {limits} effort="0" velocity="1"/>')
    proof = prove(write(convert(urdf_xml), tmp_path / "a.osim").path, urdf_xml, states=20)
    assert proof.passed, proof.table()


def test_links_without_mass_between_joints_are_proved_as_frames_that_move(tmp_path: Path) -> None:
    side = '<axis xyz="0 1 0"/><origin xyz="0.1 0.2 0.3"/>'
    urdf_xml = robot(
        link("a"),
        link("b", ""),
        link("c"),
        joint("j", "revolute", "a", "b"),
        joint("k", "revolute", "b", "c", LIMIT + side),
    )
    assert prove(write(convert(urdf_xml), tmp_path / "a.osim").path, urdf_xml, states=10).passed


def test_a_file_that_is_no_model_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "a.osim").write_text("<nothing/>")
    with pytest.raises(DescriptionError, match="OpenSim cannot use the model"):
        prove(tmp_path / "a.osim", one_joint())


def test_the_proof_runs_the_model_forward_and_measures_its_speed_in_processor_time(tmp_path: Path) -> None:
    path = write(convert(one_joint()), tmp_path / "a.osim").path
    forward = prove(path, one_joint(), states=1, forward=0.1).forward
    assert forward is not None and forward.simulated == pytest.approx(0.1)
    assert forward.processor >= ENOUGH
    assert forward.real_time_factor == pytest.approx(forward.runs * 0.1 / forward.processor)


def test_a_forward_run_that_is_slow_ends_early_and_reports_how_far_it_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("urdf_to_osim.proof.forward.LIMIT", 0.0)
    path = write(convert(one_joint()), tmp_path / "a.osim").path
    forward = prove(path, one_joint(), states=1, forward=0.1).forward
    assert forward is not None and forward.simulated == pytest.approx(0.01)
    assert forward.summary().startswith("forward 0.01 s: real-time factor ")
