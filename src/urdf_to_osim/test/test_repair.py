"""What a repair of inertias changes is reported, and a robot that is mostly invented is refused."""

from pathlib import Path

import numpy as np
import pytest
from small_robots import BODY, joint, link, one_joint, robot

from hric_core.command import main
from hric_core.errors import DescriptionError
from hric_core.geometry import MassProperties
from urdf_to_osim import Options, convert, prove, write
from urdf_to_osim.inertia import repaired
from urdf_to_osim.prepare import invented_joints


def body(ixx: str, izz: str) -> str:
    return f'<inertial><mass value="1"/><inertia ixx="{ixx}" ixy="0" ixz="0" iyy="1" iyz="0" izz="{izz}"/></inertial>'


def hand(fingers: int, massless: int) -> str:
    """A palm with fingers, of which some have no mass."""
    inside = [BODY] * (fingers - massless) + [""] * massless
    parts = [link("palm")]
    for number, inertial in enumerate(inside):
        parts += [link(f"finger{number}", inertial), joint(f"bend{number}", "revolute", "palm", f"finger{number}")]
    return robot(*parts)


def test_the_change_of_mass_matrix_and_inverse_dynamics_is_relative_to_the_largest_value(
    tmp_path: Path,
) -> None:
    urdf_xml, options = one_joint(child=body("1", "3")), Options(inertia="repair", gravity=(0.0, 0.0, 0.0))
    proof = prove(write(convert(urdf_xml, options), tmp_path / "a.osim").path, urdf_xml, options, states=5)
    # Second moments 1.5, 1.5, -0.5; without the negative one the moment about x, the joint's axis, is 1.5 instead of 1.
    assert proof.repaired == {
        "mass matrix": pytest.approx(1.0 / 3.0, rel=1e-5),
        "inverse dynamics": pytest.approx(1.0 / 3.0, rel=1e-5),
    }


def test_a_robot_without_a_repair_has_no_changes(tmp_path: Path) -> None:
    options = Options(inertia="repair")
    assert (
        prove(write(convert(one_joint(), options), tmp_path / "a.osim").path, one_joint(), options, states=2).repaired
        == {}
    )


def test_the_command_prints_the_changes_the_forward_run_and_the_transitions_of_friction(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    limits = '<limit lower="-1" upper="2" effort="30" velocity="1"/><dynamics friction="0.5"/>'
    (tmp_path / "a.urdf").write_text(one_joint(child=body("1", "3"), inside=limits))
    assert (
        main(
            [
                "convert",
                str(tmp_path / "a.urdf"),
                "-o",
                str(tmp_path / "a.osim"),
                "--inertia",
                "repair",
                "--states",
                "2",
            ]
        )
        == 0
    )
    out = capsys.readouterr().out
    assert "the repair of inertias changed the mass matrix by 3.3e-01 and the inverse dynamics by " in out
    assert "note: friction is -f tanh(dq/v), v [rad/s or m/s]: swing 0.01" in out
    assert "\nforward 0.1 s: real-time factor " in out


@pytest.mark.parametrize(("fingers", "massless"), [(1, 1), (4, 3), (9, 9)])
def test_a_robot_whose_mass_is_mostly_invented_is_refused_until_that_is_requested(fingers: int, massless: int) -> None:
    with pytest.raises(
        DescriptionError,
        match=f"small would mostly be invented: {massless} of {fingers} joints .bend.*convert with inertia invent$",
    ):
        convert(hand(fingers, massless), Options(inertia="repair"))
    assert len(convert(hand(fingers, massless), Options(inertia="invent")).notes) == massless


def test_a_robot_with_some_links_without_mass_is_repaired() -> None:
    conversion = convert(hand(4, 2), Options(inertia="repair"))
    assert invented_joints(conversion.plan.described, conversion.plan.robot) == ["bend2", "bend3"]


def test_a_tensor_that_was_moved_to_the_nearest_of_a_body_is_not_invented_however_far() -> None:
    note = convert(one_joint(child=body("0.1", "9")), Options(inertia="repair")).notes[0]
    assert "changed to the nearest possible one" in note


def test_masses_without_inertia_far_from_the_axis_invent_little() -> None:
    point = (
        '<inertial><origin xyz="0 1 0"/><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" '
        'izz="0"/></inertial>'
    )
    assert "ball of water" in convert(one_joint(child=point), Options(inertia="repair")).notes[0]


def test_what_is_left_of_a_zero_is_no_inertia() -> None:
    rest = (
        '<inertial><origin xyz="0 1 0"/><mass value="1"/><inertia ixx="2e-35" ixy="0" ixz="0" iyy="-2e-35" '
        'iyz="0" izz="0"/></inertial>'
    )
    with pytest.raises(DescriptionError, match=r"it has 1\.0 kg but no inertia"):
        convert(one_joint(child=rest))
    assert "it got the inertia of a ball of water" in convert(one_joint(child=rest), Options(inertia="repair")).notes[0]


def test_a_litre_of_water_as_a_ball_has_two_fifths_of_its_mass_times_its_radius_squared() -> None:
    mended, note = repaired(MassProperties(1.0, np.zeros(3), np.zeros((3, 3))))
    assert mended.inertia == pytest.approx(1.5393e-3 * np.eye(3), rel=1e-4)  # radius 62.035 mm
    assert note == "it got the inertia of a ball of water with a radius of 0.062 m"
