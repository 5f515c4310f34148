"""Invalid robot descriptions are refused with the same error by all readers: engines, arm model, converter, limits,
transmissions."""

from collections.abc import Callable

import pytest

from franka_hw_interface.kdl_chain import KdlChain
from hric_control.limits import load_limits
from hric_control.transmission import parse_transmissions
from hric_core.errors import DescriptionError
from opensim_ros_control.plant import OpenSimPlant
from pybullet_ros_control.plant import PyBulletPlant
from urdf_to_osim import convert

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
ARM = f"""<robot name="r"><link name="base"/><link name="arm">{INERTIAL}</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1e0" upper="1" effort="9" velocity="9"/></joint></robot>"""

READERS: dict[str, Callable[[str], object]] = {
    "PyBullet": lambda urdf_xml: PyBulletPlant(urdf_xml, ["turn"], {}),
    "OpenSim": lambda urdf_xml: OpenSimPlant(urdf_xml, ["turn"], {}),
    "KDL": lambda urdf_xml: KdlChain(urdf_xml, "base", "arm"),
    "converter": convert,
    "limits": lambda urdf_xml: load_limits(urdf_xml, None, ["turn"]),
    "transmissions": parse_transmissions,
}
WRONG = {
    "an <inertial> without <mass>": ('<mass value="1"/>', "", "link arm: <inertial> needs <mass"),
    "a negative mass": ('value="1"', 'value="-1"', "link arm: its mass -1.0 kg is negative"),
    "an unknown joint type": ("revolute", "screw", "joint turn: unknown type 'screw'"),
    "a joint to a missing link": ('child link="arm"', 'child link="hand"', "joint turn: no link 'hand'"),
    "a number that is not finite": ('ixx="0.1"', 'ixx="nan"', "link arm: ixx of <inertia> must be a finite number"),
}


@pytest.mark.parametrize("reader", READERS)
def test_whoever_reads_a_description_takes_a_good_one(reader: str) -> None:
    assert READERS[reader](ARM) is not None


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("reader", READERS)
def test_whoever_reads_a_description_refuses(reader: str, wrong: str) -> None:
    before, after, message = WRONG[wrong]
    with pytest.raises(DescriptionError, match=message):
        READERS[reader](ARM.replace(before, after))
