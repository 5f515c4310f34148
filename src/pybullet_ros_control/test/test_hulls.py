"""Convex hulls of meshes have their sides, in the engine, at the same places as the mesh."""

from itertools import product

import numpy as np
import pytest

from hric_core.meshes.canonical import MeshSurface
from pybullet_ros_control.hulls import SKIN, without_skin
from pybullet_ros_control.plant import PyBulletPlant

BOX = "".join(f"v {x} {y} {z}\n" for x, y, z in product((-0.1, 0.1), repeat=3))
FACES = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
ROBOT = """<robot name="r"><link name="base"/>
<link name="a">{0}</link><link name="b">{0}</link>
<joint name="turn" type="prismatic"><axis xyz="1 0 0"/><parent link="base"/><child link="a"/>{1}</joint>
<joint name="slide" type="prismatic"><axis xyz="1 0 0"/><parent link="base"/><child link="b"/>{1}</joint></robot>"""
LIMIT = '<limit lower="-1" upper="1" effort="9" velocity="9"/>'


def cuboid(x: float, y: float, z: float) -> MeshSurface:
    """Return the mesh of a cuboid with these edges [m]; its face indices do not matter here."""
    return MeshSurface(
        np.array(list(product((-x / 2, x / 2), (-y / 2, y / 2), (-z / 2, z / 2)))), np.zeros((0, 3), int)
    )


def test_the_sides_of_a_hull_lie_inwards_by_the_skin() -> None:
    assert np.ptp(without_skin(cuboid(0.2, 0.1, 0.05)).vertices, axis=0) == pytest.approx(
        np.array([0.2, 0.1, 0.05]) - 2 * SKIN
    )


def test_a_plate_thinner_than_the_skins_keeps_half_of_itself() -> None:
    assert np.ptp(without_skin(cuboid(0.2, 0.1, 0.001)).vertices, axis=0)[2] == pytest.approx(0.0005)


@pytest.mark.parametrize(("distance", "touching"), [(0.2005, False), (0.1995, True)])
def test_two_meshes_touch_where_their_sides_do(tmp_path, distance: float, touching: bool) -> None:
    (tmp_path / "box.obj").write_text(BOX + FACES)
    shape = (
        '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'<collision><geometry><mesh filename="{tmp_path}/box.obj"/></geometry></collision>'
    )
    plant = PyBulletPlant(ROBOT.format(shape, LIMIT), ["turn", "slide"], {"gravity": [0.0] * 3})
    try:
        plant.reset([0.0, distance])
        plant.apply([0.0, 0.0])
        plant.step()
        assert bool(plant.contacts()) == touching
    finally:
        plant.close()
