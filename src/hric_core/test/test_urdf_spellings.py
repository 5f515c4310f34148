"""Spellings of one small robot: what urdfdom reads is read as the same robot, or refused in one line that names it."""

import numpy as np
import pinocchio as pin
import pytest

from hric_core.errors import DescriptionError
from hric_core.urdf import read

PLAIN = """<?xml version="1.0"?>
<robot name="r"><link name="base"/><link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><origin xyz="0 0 0.5" rpy="0 0 0.25"/><axis xyz="0 0 1"/><parent link="base"/><child link="a"/>
  <limit lower="-1" upper="1" effort="10" velocity="1"/></joint></robot>"""  # noqa: E501
QUATERNION = PLAIN.replace('rpy="0 0 0.25"', 'quat_xyzw="0 0 0.12467473338522769 0.992197667229329"')
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'


def version(number: str, text: str = PLAIN) -> str:
    return text.replace("<robot ", f'<robot version="{number}" ')


def shaped(geometry: str) -> str:
    return PLAIN.replace("</inertial>", f"</inertial><collision><geometry>{geometry}</geometry></collision>")


READ = {
    "plain": PLAIN,
    "byte order mark": "\ufeff" + PLAIN,
    "byte order mark and a blank line": "\ufeff\n" + PLAIN,
    "blank line": "\n \t" + PLAIN,
    "line ends of Windows": PLAIN.replace("\n", "\r\n"),
    "default namespace": PLAIN.replace("<robot ", '<robot xmlns="http://www.ros.org" '),
    "namespace of xacro": PLAIN.replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" '),
    "prefixes that are not declared": PLAIN.replace("<axis", '<drake:limit/><axis drake:kind="1"'),
    "exponent": PLAIN.replace("0.5", "5.0E-1"),
    "signs and bare points": PLAIN.replace('"0 0 0.5"', '"+0. -0. .5"').replace('upper="1"', 'upper=" +1."'),
    "spaces": PLAIN.replace('"0 0 0.5"', '" 0  0 0.5 "'),
    "two origins": PLAIN.replace("<axis", '<origin xyz="9 9 9"/><axis'),
    "two inertials": PLAIN.replace("</inertial>", f'</inertial><inertial><mass value="7"/>{INERTIA}</inertial>'),
    "two limits": PLAIN.replace("</joint>", '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'),
    "attribute in capitals beside it": PLAIN.replace("rpy=", 'RPY="1 1 1" rpy='),
    "doctype": PLAIN.replace("<robot", "<!DOCTYPE robot><robot", 1),
    "version 1.0": version("1.0"),
    "version 1.1": version("1.1"),
    "version 1.2 with a capsule": version("1.2", shaped('<capsule radius="0.1" length="0.5"/>')),
    "capsule before 1.2": shaped('<capsule radius="0.1" length="0.5"/>'),
    "quaternion": version("1.1", QUATERNION),
    "quaternion of twice the length": version(
        "1.2", QUATERNION.replace("0.12467473338522769 0.992197667229329", "0.24934946677045538 1.984395334458658")
    ),
    "unknown element beside a geometry": shaped('<box size="1 1 1"/><drake:declare_convex/>'),
    "unknown element before a geometry": shaped('<drake:declare_convex/><box size="1 1 1"/>'),
    "unknown element in a geometry": shaped('<mesh filename="a.stl"><drake:declare_convex/></mesh>'),
}
REFUSED = {
    "comma decimals": (PLAIN.replace("0.25", "0,25"), "rpy of <origin> must be a finite number; got '0,25'"),
    "commas between": (PLAIN.replace('"0 0 0.5"', '"0, 0, 0.5"'), "xyz of <origin> must be a finite number; got '0,'"),
    "hexadecimal": (PLAIN.replace("0.25", "0x1p-2"), "got '0x1p-2'"),
    "underscore": (PLAIN.replace('mass value="1"', 'mass value="1_0"'), "value of <mass> must be .* got '1_0'"),
    "digits of another script": (PLAIN.replace("0.25", "٠.٢٥"), "got '٠.٢٥'"),
    "digits of full width": (PLAIN.replace("0.25", "０.２５"), "got '０.２５'"),
    "degrees": (PLAIN.replace("0.25", "14.3°"), "got '14.3°'"),
    "suffix of C": (PLAIN.replace('upper="1"', 'upper="1.0f"'), "upper of <limit> must be .* got '1.0f'"),
    "exponent of Fortran": (PLAIN.replace('upper="1"', 'upper="1d0"'), "got '1d0'"),
    "infinite": (PLAIN.replace('upper="1"', 'upper="inf"'), "got 'inf'"),
    "no number": (PLAIN.replace('upper="1"', 'upper="nan"'), "got 'nan'"),
    "too large": (PLAIN.replace('upper="1"', 'upper="1e999"'), "got '1e999'"),
    "empty": (PLAIN.replace('rpy="0 0 0.25"', 'rpy=""'), "rpy of <origin> must be 3 numbers; got ''"),
    "angle in degrees": (
        PLAIN.replace("0.25", "90"),
        r"joint j: rpy of .* 90, beyond 12\.57 \[rad\]; 90 deg would be 1\.57",
    ),
    "distance in mm": (
        PLAIN.replace('xyz="0 0 0.5"', 'xyz="0 0 500"'),
        r"xyz of .* 500, beyond 30 \[m\]; 500 mm would be 0\.5",
    ),
    "version 9.0": (version("9.0"), r"has version '9.0'; valid: 1.0, 1.1, 1.2"),
    "version 1": (version("1"), "has version '1'"),
    "no version": (version(""), "has version ''"),
    "quaternion without a version": (
        QUATERNION,
        "joint j: quat_xyzw of <origin> needs URDF 1.1, and the description has version 1.0",
    ),
    "quaternion in 1.0": (version("1.0", QUATERNION), "joint j: quat_xyzw"),
    "quaternion and angles": (version("1.1", QUATERNION.replace("quat", 'rpy="0 0 1" quat')), "needs either rpy, or"),
    "quaternion of three": (version("1.1", QUATERNION.replace('"0 0 0.12', '"0 0.12')), "quat_xyzw of .* 4 numbers"),
    "quaternion of nothing": (
        version("1.1", QUATERNION.replace("0.12467473338522769 0.992197667229329", "0 0")),
        "joint j: <origin> needs either rpy, or a quat_xyzw that is not zero",
    ),
    "two geometries": (
        shaped('<box size="1 1 1"/><sphere radius="1"/>'),
        "its geometry is <box>, <sphere>; valid: one",
    ),
    "mesh of no file": (shaped("<mesh/>"), "link a: <collision> number 1: <mesh> has no filename"),
    "prefix of the root": (
        PLAIN.replace("<robot ", "<u:robot ").replace("</robot", "</u:robot"),
        "starts with <u:robot>",
    ),
    "xacro that is not expanded": (
        PLAIN.replace("<axis", '<xacro:if value="true"/><axis'),
        "contains <xacro:if>; expand it with xacro first",
    ),
    "entity that is not declared": (PLAIN.replace("0.5", "&h;"), "not XML: undefined entity"),
}


def described(text: str) -> list[float]:
    """Height and angle of the joint, its limits, and the mass behind it, as read here."""
    robot = read(text)
    joint = robot.joints["j"]
    T = joint.T_parent_joint
    mass = robot.links["a"].mass
    assert mass is not None
    return [float(T[2, 3]), float(np.arctan2(T[1, 0], T[0, 0])), joint.lower, joint.upper, mass.mass, *mass.com]


def by_urdfdom(text: str) -> list[float]:
    model = pin.buildModelFromXML(text)
    T, mass = model.jointPlacements[1], model.inertias[1]
    angle = float(np.arctan2(T.rotation[1, 0], T.rotation[0, 0]))
    limits = float(model.lowerPositionLimit[0]), float(model.upperPositionLimit[0])
    return [float(T.translation[2]), angle, *limits, mass.mass, *mass.lever]


@pytest.mark.parametrize("name", READ)
def test_a_spelling_that_urdfdom_reads_is_the_same_robot(name: str) -> None:
    assert described(READ[name]) == pytest.approx(by_urdfdom(READ[name]), abs=1e-12)
    assert described(READ[name])[:5] == pytest.approx([0.5, 0.25, -1.0, 1.0, 1.0], abs=1e-12)


@pytest.mark.parametrize("name", REFUSED)
def test_a_spelling_that_cannot_be_meant_is_refused_in_one_line(name: str) -> None:
    text, message = REFUSED[name]
    with pytest.raises(DescriptionError, match=message) as error:
        read(text)
    assert "\n" not in str(error.value)


def test_a_line_end_between_numbers_and_an_entity_that_is_declared_are_read_although_urdfdom_does_not() -> None:
    entity = PLAIN.replace("<robot", "<!DOCTYPE robot [<!ENTITY h '0.5'>]><robot", 1).replace("0 0 0.5", "0 0 &h;")
    for text in (PLAIN.replace('"0 0 0.5"', '"0\n 0\t0.5"'), entity):
        assert described(text) == described(PLAIN)
