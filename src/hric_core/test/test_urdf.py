"""Reader of robot descriptions: content of the tree, refused descriptions, and reading of written elements."""

import math
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hric_core.errors import DescriptionError, UnknownNameError
from hric_core.geometry import homogeneous
from hric_core.urdf import Limit, Shape, mimic_laws, read, write_inertial, write_origin, write_shape
from hric_core.urdf.robot import SafetyController

TENSOR = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/>'
BODY = f'<inertial><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><mass value="1.5e0"/>{TENSOR}</inertial>'
LIMIT = '<limit lower="-1" upper="2" effort="40" velocity="3"/>'


def link(name: str, inside: str = BODY) -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = LIMIT) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def robot(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


def one_joint(kind: str = "revolute", inside: str = LIMIT):
    return read(robot(link("a"), link("b"), joint("j", "a", "b", kind, inside))).joints["j"]


ARM = robot(
    link("tool"), link("base"), link("upper"), link("lower"), link("box", ""),
    joint("hold", "lower", "tool", "fixed", '<origin xyz="0 0 0.1"/>'), joint("elbow", "upper", "lower"),
    joint("shoulder", "base", "upper", "revolute", f'{LIMIT}<origin xyz="0.3 0 0" rpy="0 0 1.5707963267948966"/>'),
    joint("side", "upper", "box", "fixed", '<origin xyz="0 0.2 0"/>'),
)  # fmt: skip


def test_joints_go_from_the_root_outwards_and_links_stand_as_in_the_document() -> None:
    arm = read(ARM)
    assert (arm.name, arm.root, list(arm.links)) == ("r", "base", ["tool", "base", "upper", "lower", "box"])
    assert list(arm.joints) == ["shoulder", "elbow", "hold", "side"]
    assert [joint.name for joint in arm.path("base", "tool")] == ["shoulder", "elbow", "hold"]
    assert [(joint.name, T[:3, 3].tolist()) for joint, T in arm.beyond("upper", None, "elbow")] == [
        ("side", [0.0, 0.2, 0.0])
    ]
    groups = {name: top for name, (top, _) in arm.rigid_groups().items()}
    assert groups == {"base": "base", "upper": "upper", "lower": "lower", "tool": "lower", "box": "upper"}


def test_poses_follow_revolute_and_prismatic_joints() -> None:
    slides = read(robot(link("a"), link("b"), joint("j", "a", "b", "prismatic", f'{LIMIT}<axis xyz="0 1 0"/>')))
    assert slides.poses({"j": 0.4})["b"][:3, 3].tolist() == [0.0, 0.4, 0.0]
    turned = read(ARM).poses({"shoulder": np.pi / 2})  # about x of its frame, whose y is -x of the base
    assert turned["box"][:3, 3] == pytest.approx([0.3, 0.0, 0.2]) and turned["base"] == pytest.approx(np.eye(4))


def test_a_path_that_is_none_is_refused() -> None:
    arm = read(ARM)
    with pytest.raises(DescriptionError, match="link base is not a descendant of link tool"):
        arm.path("tool", "base")
    with pytest.raises(UnknownNameError, match="no link 'hand' in robot r; valid: base, box, lower, tool, upper"):
        arm.path("base", "hand")


def test_the_mass_of_a_link_is_given_in_the_axes_of_the_link() -> None:
    mass = read(ARM).links["tool"].mass
    assert mass.mass == 1.5
    assert mass.com == pytest.approx([0.1, 0.0, 0.0])
    assert mass.inertia == pytest.approx(np.diag([0.2, 0.1, 0.25]))
    assert read(ARM).links["box"].mass is None


def test_a_joint_has_its_frame_a_unit_axis_its_losses_and_whom_it_mimics() -> None:
    inside = f'{LIMIT}<axis xyz="0 3 4"/><dynamics damping="1e-3" friction="0.2"/>'
    source = one_joint(inside=inside)
    assert source.axis.tolist() == [0.0, 0.6, 0.8]
    assert (source.damping, source.friction) == (0.001, 0.2)
    T = homogeneous(Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix(), [0.3, 0, 0])
    assert np.abs(read(ARM).joints["shoulder"].T_parent_joint - T).max() < 1e-15
    follower = joint("k", "b", "c", inside=f'{LIMIT}<mimic joint="j" multiplier="-2"/>')
    mimic = read(robot(link("a"), link("b"), link("c"), joint("j", "a", "b"), follower)).joints["k"].mimic
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("j", -2.0, 0.0)


def driven(rotor: str, extra: str = "") -> str:
    actuator = f'<actuator name="m"><drake:rotor_inertia value="{rotor}"/>{extra}</actuator>'
    transmission = f'<transmission name="t"><joint name="j"/>{actuator}</transmission>'
    return robot(link("a"), link("b"), joint("j", "a", "b", inside=LIMIT), transmission)


@pytest.mark.parametrize(("extra", "inertia"), [("", 0.3), ('<drake:gear_ratio value="-10"/>', 30.0)])
def test_the_rotor_inertia_is_reflected_to_the_joint(extra: str, inertia: float) -> None:
    assert read(driven("0.3", extra)).joints["j"].rotor_inertia == pytest.approx(inertia)


def test_a_joint_may_state_no_rotor() -> None:
    assert one_joint().rotor_inertia is None


FOLLOWERS = robot(
    link("a"), link("b"), link("c"), link("d"),
    joint("last", "c", "d", inside=f'{LIMIT}<mimic joint="middle" multiplier="3" offset="0.5"/>'),
    joint("middle", "b", "c", inside=f'{LIMIT}<mimic joint="first" multiplier="-2" offset="0.1"/>'),
    joint("first", "a", "b"),
)  # fmt: skip


def test_a_chain_of_joints_that_mimic_each_other_follows_the_one_at_its_end() -> None:
    laws = mimic_laws(read(FOLLOWERS).joints)
    assert {name: (law.joint, law.multiplier, law.offset) for name, law in laws.items()} == {
        "middle": ("first", -2.0, 0.1),
        "last": ("first", -6.0, pytest.approx(0.8)),
    }


def test_a_joint_that_mimics_another_is_not_driven_by_itself() -> None:
    tree = read(FOLLOWERS)
    tree.check_actuated(["first"])
    with pytest.raises(DescriptionError, match="joint last: it mimics middle and cannot be driven by itself; remove"):
        tree.check_actuated(["first", "last"])
    with pytest.raises(UnknownNameError, match="no moving joint 'second' in robot r; valid: first, last, middle"):
        tree.check_actuated(["second"])
    with pytest.raises(DescriptionError, match="robot r: no joint to drive; give at least one a <transmission>"):
        tree.check_actuated([])


def test_neighbours_are_all_links_between_which_one_joint_moves_at_the_most() -> None:
    pairs = " ".join(sorted("-".join(sorted(pair)) for pair in read(ARM).neighbours()))
    assert pairs == "base-box base-upper box-lower box-tool box-upper lower-tool lower-upper tool-upper"


@pytest.mark.parametrize(
    ("kind", "limit", "means"),
    [
        ("revolute", 'lower="-1" upper="2" effort="40" velocity="3"', (-1.0, 2.0, 40.0, 3.0)),
        ("prismatic", 'upper="0.04"', (0.0, 0.04, math.inf, math.inf)),
        ("continuous", 'lower="-1" upper="1" effort="0" velocity="-1"', (-math.inf, math.inf, math.inf, math.inf)),
        ("revolute", 'lower="-1e16" upper="1e16"', (-math.inf, math.inf, math.inf, math.inf)),
        ("revolute", 'lower="-1e16" upper="1"', (-1e4, 1.0, math.inf, math.inf)),
    ],
)
def test_a_limit_means_infinity_where_there_is_none(kind: str, limit: str, means: tuple[float, ...]) -> None:
    found = one_joint(kind, f"<limit {limit}/>")
    assert (found.lower, found.upper, found.effort, found.velocity) == means


def test_limit_and_safety_controller_are_kept_as_written() -> None:
    found = one_joint(inside='<limit upper="1" effort="0"/><safety_controller k_velocity="40" soft_upper_limit="0.9"/>')
    assert found.limit == Limit(0.0, 1.0, 0.0, None)
    assert found.safety == SafetyController(40.0, 0.0, 0.0, 0.9)
    assert one_joint("continuous", "").limit is None


def test_shapes_have_kind_size_pose_and_the_colour_of_their_own_or_of_a_named_material() -> None:
    named = '<material name="blue"><color rgba="0 0 2 1"/></material>'
    sphere = (
        '<visual><origin xyz="0 0 1e-1"/><geometry><sphere radius="0.1"/></geometry><material name="blue"/></visual>'
    )
    own = (
        '<visual><geometry><box size="1 2 3"/></geometry><material name="m"><color rgba="1 0 0 '
        '0.5"/></material></visual>'
    )
    mesh = '<collision><geometry><mesh filename="a.stl" scale="1 -1 1"/></geometry></collision>'
    cylinder = '<collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>'
    found = read(robot(named, link("a", f"{BODY}{sphere}{own}{mesh}{cylinder}"))).links["a"]
    assert [(s.where, s.kind, s.size, s.colour) for s in found.visuals] == [
        ("link a: <visual> number 1", "sphere", (0.1,), (0.0, 0.0, 1.0, 1.0)),
        ("link a: <visual> number 2", "box", (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.5)),
    ]
    assert found.visuals[0].T_link_shape[2, 3] == 0.1
    assert [(s.kind, s.size, s.address, s.colour) for s in found.collisions] == [
        ("mesh", (1.0, -1.0, 1.0), "a.stl", None),
        ("cylinder", (0.1, 0.5), "", None),
    ]


def test_what_is_written_is_read_again_bit_by_bit() -> None:
    rng = np.random.default_rng(0)
    R = Rotation.random(rng=rng).as_matrix()
    T, moments = homogeneous(R, rng.normal(size=3)), np.diag(rng.uniform(0.1, 0.2, 3))
    written = Element("link", name="a")
    write_inertial(written, 1 / 3, T, moments)
    sizes = {"box": (0.1, 1 / 3, 2.0), "capsule": (0.1, 1 / 3), "sphere": (1 / 7,)}
    shapes = [Shape("", kind, size, T, colour=(0.1, 0.2, 1 / 3, 1.0)) for kind, size in sizes.items()]
    shapes.append(Shape("", "mesh", (1.0, 1.0, -1.0), T, "package://a/b.stl"))
    for shape in shapes:
        write_shape(written, "visual", shape, T)
    found = read(robot(ElementTree.tostring(written, encoding="unicode"))).links["a"]
    assert (found.mass.mass, found.mass.com.tolist()) == (1 / 3, T[:3, 3].tolist())
    assert np.abs(found.mass.inertia - R @ moments @ R.T).max() < 1e-15
    assert [(s.kind, s.size, s.address, s.colour) for s in found.visuals] == [
        (s.kind, s.size, s.address, s.colour) for s in shapes
    ]
    assert all(np.abs(s.T_link_shape - T).max() < 1e-15 for s in found.visuals)
    write_origin(written, T)
    assert written[-1].get("xyz") == " ".join(repr(float(x)) for x in T[:3, 3])


def inertial(mass: str = "1", inertia: str = TENSOR) -> str:
    return f"<inertial>{mass}{inertia}</inertial>"


REFUSED = {
    "not XML": ("<robot", "the robot description is not XML"),
    "nothing": ("", "not XML"),
    "another root element": ("<sdf/>", r"starts with <sdf>; it must be <robot> \(a .xacro file must be expanded"),
    "no link": (robot(), "no <link>; a robot needs at least one"),
    "link without a name": (robot("<link/>"), "<link> number 1 of the robot description has no name"),
    "link twice": (robot(link("a"), link("a")), "link 'a' is defined twice"),
    "joint twice": (
        robot(link("a"), link("b"), joint("j", "a", "b"), joint("j", "a", "b")),
        "joint 'j' is defined twice",
    ),
    "unknown joint type": (
        robot(link("a"), link("b"), joint("j", "a", "b", "screw")),
        "joint j: unknown type 'screw'; valid: revolute",
    ),
    "missing link": (robot(link("a"), joint("j", "a", "b")), "joint j: no link 'b'; valid: a"),
    "no parent": (
        robot(link("a"), '<joint name="j" type="fixed"><child link="a"/></joint>'),
        "joint j: no <parent link=...>",
    ),
    "two roots": (robot(link("a"), link("b")), "needs one root link; it has 2: a, b"),
    "cycle": (
        robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
        "one root link; it has 0: its joints form a cycle",
    ),
    "cycle beside a root": (
        robot(link("r"), link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
        "joints j, k form a cycle that is not connected to the root link r",
    ),
    "two parents": (
        robot(link("a"), link("b"), link("c"), joint("j", "a", "c"), joint("k", "b", "c"), joint("m", "a", "b")),
        "link c has two parent joints, j and k",
    ),
    "no mass": (robot(link("a", inertial(""))), "link a: <inertial> needs <mass value=...> and <inertia"),
    "no inertia": (
        robot(link("a", inertial('<mass value="1"/>', ""))),
        "link a: <inertial> needs <mass value=...> and <inertia",
    ),
    "mass without value": (robot(link("a", inertial("<mass/>"))), "link a: <mass> has no value"),
    "negative mass": (robot(link("a", inertial('<mass value="-1"/>'))), "link a: its mass -1.0 kg is negative"),
    "no number": (
        robot(link("a", inertial('<mass value="two"/>'))),
        "link a: value of <mass> must be a finite number; got 'two'",
    ),
    "not finite": (
        robot(link("a", inertial('<mass value="1"/>', TENSOR.replace("0.1", "inf")))),
        "link a: ixx of <inertia> must be a finite",
    ),
    "no axis": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside=f'{LIMIT}<axis xyz="0 0 0"/>')),
        "joint j: its axis .* has length 0",
    ),
    "short axis": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside=f'{LIMIT}<axis xyz="0 1"/>')),
        "joint j: xyz of <axis> must be 3",
    ),
    "short origin": (
        robot(link("a"), link("b"), joint("j", "a", "b", "fixed", '<origin rpy="1"/>')),
        "joint j: rpy of <origin> must be 3",
    ),
    "no limit": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside="")),
        "joint j: a revolute joint needs <limit",
    ),
    "limits crossed": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside='<limit lower="1"/>')),
        "joint j: its lower limit 1.0 is above",
    ),
    "negative effort": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside='<limit effort="-1"/>')),
        "joint j: its effort limit -1.0",
    ),
    "negative damping": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside=f'{LIMIT}<dynamics damping="-1"/>')),
        "joint j: damping -1.0 and friction 0.0 must not be negative",
    ),
    "safety without gain": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside=f"{LIMIT}<safety_controller/>")),
        "joint j: <safety_controller> has no k_velocity",
    ),
    "mimic of nothing": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside=f'{LIMIT}<mimic joint="k"/>')),
        "joint j: it mimics 'k', which is not a joint; valid: j",
    ),
    "mimic of itself": (
        robot(link("a"), link("b"), joint("j", "a", "b", inside=f'{LIMIT}<mimic joint="j"/>')),
        "joint j: the joints mimic each other in a circle: j -> j",
    ),
    "mimic of a fixed joint": (
        robot(
            link("a"),
            link("b"),
            link("c"),
            joint("f", "a", "b", "fixed"),
            joint("j", "b", "c", inside=f'{LIMIT}<mimic joint="f"/>'),
        ),
        "joint j: it mimics f, a fixed joint; valid types: revolute",
    ),
    "no geometry": (
        robot(link("a", "<visual/>")),
        "link a: <visual> number 1: its geometry is none; valid: one of box, sphere",
    ),
    "unknown geometry": (
        robot(link("a", "<visual><geometry><cone/></geometry></visual>")),
        "link a: <visual> number 1: its geometry is <cone>",
    ),
    "size of two numbers": (
        robot(link("a", '<collision><geometry><box size="1 1"/></geometry></collision>')),
        "link a: <collision> number 1: size of <box> must be 3 numbers; got '1 1'",
    ),
    "negative rotor inertia": (
        robot(
            link("a"),
            '<transmission><joint name="j"/><actuator><drake:rotor_inertia value="-1"/></actuator></transmission>',
        ),
        "rotor of joint j: its inertia -1.0 kg m.2 is negative",
    ),
    "sphere without radius": (
        robot(link("a", "<visual><geometry><sphere/></geometry></visual>")),
        "number 1: <sphere> has no radius",
    ),
    "negative size": (
        robot(link("a", '<visual><geometry><box size="1 1 -1"/></geometry></visual>')),
        "link a: <visual> number 1: a <box> of size 1 1 -1 m; none may be negative",
    ),
    "colour of three numbers": (
        robot(link("a"), '<material name="m"><color rgba="1 1 1"/></material>'),
        "material m: rgba of <color> must be 4",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_with_one_line_that_names_the_element(name: str) -> None:
    urdf_xml, message = REFUSED[name]
    with pytest.raises(DescriptionError, match=message) as error:
        read(urdf_xml)
    assert "\n" not in str(error.value)


def test_an_error_begins_with_the_name_of_the_file_where_there_is_one() -> None:
    with pytest.raises(DescriptionError, match=r"^box\.urdf: link a: its mass -1.0 kg is negative"):
        read(REFUSED["negative mass"][0], "box.urdf")
