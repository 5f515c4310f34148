"""What cannot be converted is refused with one error that names the element and says what to do."""

import pytest
from small_robots import BODY, joint, link, one_joint, robot

from hric_core.errors import DescriptionError, HricError, ParameterError, UnknownNameError
from urdf_to_osim import Options, convert, write

ARM = "link arm"


def inertial(mass: str, xx: str, yy: str, zz: str) -> str:
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" '
        f'izz="{zz}"/></inertial>'
    )


REFUSED = {
    "zero inertia": (
        one_joint(child=inertial("1", "0", "0", "0")),
        f"{ARM}: it has 1.0 kg but no inertia; correct .* inertia repair",
    ),
    "inertia without mass": (one_joint(child=inertial("0", "1", "1", "1")), f"{ARM}: it has an inertia but no mass"),
    "negative inertia": (one_joint(child=inertial("1", "-1", "1", "1")), f"{ARM}: its inertia is not positive"),
    "triangle inequality": (
        one_joint(child=inertial("1", "1", "1", "3")),
        f"{ARM}: its inertia breaks the triangle inequality",
    ),
    "massless moving leaf": (
        one_joint(child=""),
        f"{ARM}: joint swing moves it, but it and what is fixed to it have no mass; give it",
    ),
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
        "link b: joint j moves it, and neither it nor the link that follows has mass, which OpenSim cannot "
        "simulate; give it",
    ),
    "blank in a link's name": (
        robot(link("a b")),
        r"link 'a b': OpenSim forbids the name \(it contains ' '\); rename it",
    ),
    "slash in a joint's name": (
        robot(link("a"), link("b"), joint("x/y", "fixed", "a", "b")),
        "joint 'x/y': OpenSim forbids the name",
    ),
    "link called ground": (robot(link("ground")), "link 'ground': OpenSim forbids the name"),
    "coordinate twice": (
        robot(
            link("a"), link("b"), link("c"), joint("j", "floating", "a", "b", ""), joint("j_rx", "revolute", "b", "c")
        ),
        "joint j_rx: its coordinate j_rx is also one of joint j",
    ),
    "flat box for contact": (
        robot(link("a", f'{BODY}<collision><geometry><box size="1 1 0"/></geometry></collision>')),
        "link a: <collision> number 1: a <box> of size 1 1 0; all must be above 0",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_with_one_error_that_names_the_element(name: str) -> None:
    urdf_xml, message = REFUSED[name]
    with pytest.raises(DescriptionError, match=message) as error:
        convert(urdf_xml, Options(contact=True))
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
        ({"up": "x"}, "up is 'x'; valid: y, z"),
        ({"inertia": "guess"}, "inertia is 'guess'; valid: refuse, repair, invent, keep"),
        ({"stop_stiffness": 0.0}, "stop_stiffness is 0.0; valid: a finite number above 0"),
        ({"stop_damping": -1.0}, "stop_damping is -1.0"),
        ({"gravity": 9.81}, "gravity is 9.81; valid: a list of 3 finite numbers"),
        ({"friction": "sigmoid"}, "friction_parameters"),
        (
            {"friction": "sigmoid", "friction_parameters": {"swing": {"phi1": 1.0}}},
            "phi1, phi2 and phi3 of swing are missing",
        ),
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
