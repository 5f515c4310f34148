"""What cannot be converted is refused with one error that names the element and says what to do."""

from __future__ import annotations

import pytest
from small_robots import BODY, LIMIT, gripper, joint, link, one_joint, robot

from hric_control.errors import DescriptionError, HricError, ParameterError, UnknownNameError
from urdf_to_osim import Options, convert, write

ARM = "link arm"


def inertial(mass: str, xx: str, yy: str, zz: str) -> str:
    return f'<inertial><mass value="{mass}"/><inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial>'


REFUSED = {
    "not XML": ("<robot", "not XML"),
    "nothing": ("", "not XML"),
    "another root element": ("<sdf/>", "starts with <sdf>"),
    "no link": ("<robot name='a'/>", "no <link>"),
    "link without a name": (robot("<link/>"), "<link> number 1 has no name"),
    "link twice": (robot(link("a"), link("a")), "link 'a' stands twice"),
    "joint twice": (robot(link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("j", "fixed", "a", "b")), "joint 'j' stands twice"),
    "unknown joint type": (one_joint("screw"), "joint swing: unknown type 'screw'; valid: revolute"),
    "no such link": (robot(link("a"), joint("j", "fixed", "a", "b")), "joint j: no link 'b'; valid: a"),
    "no parent": (robot(link("a"), '<joint name="j" type="fixed"><child link="a"/></joint>'), "joint j: no <parent link=...>"),
    "two roots": (robot(link("a"), link("b")), "one root link; it has 2: a, b"),
    "cycle": (robot(link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")), "one root link; it has 0"),
    "cycle beside a root": (
        robot(link("r"), link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")),
        "joints j, k form a cycle",
    ),
    "two parents": (
        robot(link("a"), link("b"), link("c"), joint("j", "fixed", "a", "c"), joint("k", "fixed", "b", "c"), joint("m", "fixed", "a", "b")),
        "link c has two parent joints, j and k",
    ),
    "no axis": (one_joint(inside=f'{LIMIT}<axis xyz="0 0 0"/>'), "joint swing: its axis .* has no length"),
    "axis of two numbers": (one_joint(inside=f'{LIMIT}<axis xyz="0 1"/>'), "joint swing: xyz of <axis> must be 3 numbers"),
    "no limit": (one_joint(inside=""), "joint swing: a revolute joint needs <limit"),
    "limits crossed": (one_joint(inside='<limit lower="1" upper="0" effort="1" velocity="1"/>'), "joint swing: its lower limit 1.0 is above"),
    "negative effort": (one_joint(inside='<limit lower="0" upper="1" effort="-1" velocity="1"/>'), "joint swing: its effort limit -1.0"),
    "negative damping": (one_joint(inside=f'{LIMIT}<dynamics damping="-1"/>'), "joint swing: damping -1.0 .* must not be negative"),
    "mimic of nothing": (gripper('<mimic joint="middle"/>'), "joint right: it mimics 'middle', which is no joint; valid: left, right"),
    "mimic of itself": (gripper('<mimic joint="right"/>'), "joint right: the joints mimic each other in a circle: right -> right"),
    "no number": (one_joint(child=inertial("two", "1", "1", "1")), f"{ARM}: value of <mass> must be a finite number; got 'two'"),
    "not finite": (one_joint(child=inertial("1", "nan", "1", "1")), f"{ARM}: ixx of <inertia> must be a finite number"),
    "no inertia element": (one_joint(child='<inertial><mass value="1"/></inertial>'), f"{ARM}: <inertial> needs <mass"),
    "zero inertia": (one_joint(child=inertial("1", "0", "0", "0")), f"{ARM}: it has 1.0 kg but no inertia; correct .* inertia repair"),
    "negative mass": (one_joint(child=inertial("-1", "1", "1", "1")), f"{ARM}: its mass -1.0 kg is negative"),
    "inertia without mass": (one_joint(child=inertial("0", "1", "1", "1")), f"{ARM}: it has an inertia but no mass"),
    "negative inertia": (one_joint(child=inertial("1", "-1", "1", "1")), f"{ARM}: its inertia is not positive"),
    "triangle inequality": (one_joint(child=inertial("1", "1", "1", "3")), f"{ARM}: its inertia breaks the triangle inequality"),
    "massless moving leaf": (one_joint(child=""), f"{ARM}: joint swing moves it, but it and what is fixed to it have no mass; give it"),
    "two moving links without mass in a row": (
        robot(
            link("a"),
            link("b", ""),
            link("c", ""),
            link("d"),
            joint("j", "revolute", "a", "b"),
            joint("k", "revolute", "b", "c"),
            joint("m", "revolute", "c", "d"),
        ),
        "link b: joint j moves it, and neither it nor the link that follows has mass, which OpenSim cannot hold; give it",
    ),
    "blank in a link's name": (robot(link("a b")), r"link 'a b': OpenSim forbids the name \(it contains ' '\); rename it"),
    "slash in a joint's name": (robot(link("a"), link("b"), joint("x/y", "fixed", "a", "b")), "joint 'x/y': OpenSim forbids the name"),
    "link called ground": (robot(link("ground")), "link 'ground': OpenSim forbids the name"),
    "coordinate twice": (
        robot(link("a"), link("b"), link("c"), joint("j", "floating", "a", "b", ""), joint("j_rx", "revolute", "b", "c")),
        "joint j_rx: its coordinate j_rx is also one of joint j",
    ),
    "unknown geometry": (
        robot(link("a", f"{BODY}<visual><geometry><cone/></geometry></visual>")),
        "link a: <visual> number 1: its geometry is <cone>",
    ),
    "flat box": (robot(link("a", f'{BODY}<visual><geometry><box size="1 1 -1"/></geometry></visual>')), "link a: <visual> number 1: a <box> of size"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_with_one_error_that_names_the_element(name: str) -> None:
    urdf_xml, message = REFUSED[name]
    with pytest.raises(DescriptionError, match=message) as error:
        convert(urdf_xml)
    assert "\n" not in str(error.value)


def test_a_missing_mesh_is_one_error_with_link_and_address_and_nothing_is_written(tmp_path) -> None:
    missing = "package://urdf_to_osim/no/such.stl"
    conversion = convert(robot(link("a", f'{BODY}<visual><geometry><mesh filename="{missing}"/></geometry></visual>')))
    with pytest.raises(DescriptionError, match=f"link 'a': mesh '{missing}'"):
        write(conversion, tmp_path / "a.osim")
    assert list(tmp_path.iterdir()) == []


def test_an_open_surface_is_refused_as_contact_geometry(tmp_path) -> None:
    (tmp_path / "open.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    conversion = convert(
        robot(link("a", f'{BODY}<collision><geometry><mesh filename="open.obj"/></geometry></collision>')),
        Options(contact=True, folder=str(tmp_path)),
    )
    with pytest.raises(DescriptionError, match=r"link a: collision mesh 'open\.obj' is no closed surface"):
        write(conversion, tmp_path / "a.osim")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["open.obj"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"up": "x"}, "option up is 'x'; valid: y, z"),
        ({"inertia": "guess"}, "option inertia is 'guess'; valid: refuse, repair, invent, keep"),
        ({"stop_stiffness": 0.0}, "option stop_stiffness is 0.0; it must be a number above 0"),
        ({"stop_damping": -1.0}, "option stop_damping is -1.0"),
        ({"gravity": 9.81}, "option gravity is 9.81; it must be three finite numbers"),
        ({"friction": "sigmoid"}, "friction_parameters"),
        ({"friction": "sigmoid", "friction_parameters": {"swing": {"phi1": 1.0}}}, "phi1, phi2 and phi3 of swing are missing"),
    ],
)
def test_an_option_that_is_not_valid_is_refused(wrong: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Options(**wrong)


def test_friction_parameters_of_an_unknown_joint_are_refused_with_the_joints_that_exist() -> None:
    phi = {"swng": {"phi1": 1.0, "phi2": 1.0, "phi3": 0.0}}
    with pytest.raises(UnknownNameError, match="no joint 'swng' in friction_parameters; valid: swing"):
        convert(one_joint(), Options(friction="sigmoid", friction_parameters=phi))


@pytest.mark.parametrize("output", ["robot.xml", "no/such/folder/robot.osim"])
def test_an_output_that_cannot_be_is_refused(output: str, tmp_path) -> None:
    with pytest.raises(HricError, match=output):
        write(convert(one_joint()), tmp_path / output)
    assert list(tmp_path.iterdir()) == []
