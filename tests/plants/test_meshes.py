"""Collision meshes and shapes, read by the workspace's own readers: same result on every engine."""

import math
from pathlib import Path

import numpy as np
import pytest

from hric_core.errors import DescriptionError

BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
ROBOT = """<robot name="table"><link name="base">{}</link>
  <link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>"""  # noqa: E501
THING = """<robot name="ball"><link name="ball"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{}</link></robot>"""
COLLADA = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{asset}</asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">{corners}</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""  # noqa: E501
FACES = "0 2 1 0 1 3 0 3 2 1 2 3"
HEAP = "-1 -1 0 1 -1 0 0 1 0 0 0 0.5"
"""Vertices of a tetrahedron with its top 0.5 m above the origin."""


def collada(asset: str = "", corners: str = HEAP, faces: str = FACES) -> str:
    return COLLADA.format(asset=asset, corners=corners, faces=faces)


def obj(corners: np.ndarray, faces: list[tuple[int, ...]]) -> str:
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
    return "\n".join(rows + ["f " + " ".join(map(str, face)) for face in faces]) + "\n"


def drum(edges: int) -> str:
    """Return the mesh of a cylinder with radius and height 0.5 m on the ground, with many corners per end face."""
    angles = 2.0 * math.pi * np.arange(edges) / edges
    ring = 0.5 * np.column_stack([np.cos(angles), np.sin(angles)])
    corners = np.vstack([np.column_stack([ring, np.full(edges, z)]) for z in (0.0, 0.5)])
    sides = [(i + 1, (i + 1) % edges + 1, (i + 1) % edges + edges + 1, i + edges + 1) for i in range(edges)]
    return obj(corners, [tuple(range(edges, 0, -1)), tuple(range(edges + 1, 2 * edges + 1)), *sides])


def mesh(path: Path, attributes: str = "") -> str:
    return f'<collision><geometry><mesh filename="{path}" {attributes}/></geometry></collision>'


def rest_height(make_plant, base: str) -> float:
    """Return the height at which the lowest point of a ball on the base comes to rest [m]."""
    plant = make_plant(ROBOT.format(base), ["j"], [0.0], rotor_inertia=0.0, contact_stiffness=1e5)
    plant.spawn("ball", THING.format(BALL), [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.61], [0, 0, 0, 1]])
    for _ in range(300):
        plant.step()
    T, _ = plant.link_state("ball::ball")
    return float(T[2, 3]) - 0.1


GOOD = {
    "a unit without meter": ("heap.dae", collada("<unit/><up_axis>Z_UP</up_axis>"), ""),
    "no asset at all": ("heap.dae", collada().replace("<asset></asset>", ""), ""),
    "a unit in millimetres": ("heap.dae", collada('<unit meter="0.001" name="mm"/>'), 'scale="1e3 1e3 1e3"'),
    "an up axis, which has no effect": ("heap.dae", collada('<unit meter="1"/><up_axis>Y_UP</up_axis>'), ""),
    "a mirror": ("heap.dae", collada(corners=HEAP.replace("0.5", "-0.5")), 'scale="1 1 -1"'),
    "lids of 400 corners": ("drum.obj", drum(400), ""),
    "an ending in capitals": ("drum.OBJ", drum(12), ""),
}


@pytest.mark.parametrize("name", GOOD)
def test_a_ball_comes_to_rest_on_a_mesh_with(name: str, make_plant, tmp_path: Path) -> None:
    file, text, attributes = GOOD[name]
    (tmp_path / file).write_text(text)
    assert rest_height(make_plant, mesh(tmp_path / file, attributes)) == pytest.approx(0.5, abs=5e-3)


CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
FLAT = obj(CORNERS, [(1, 2, 3), (1, 3, 4)])
BOARD = obj(1e3 * CORNERS + np.outer([0, 1, 0, 0], [0, 0, 20]), [(1, 2, 3), (1, 3, 4), (1, 2, 4), (2, 3, 4)])
"""Mesh of a board that was drawn in mm."""
BAD = {
    "flat": ("a.obj", FLAT, "", "the mesh is flat; a collision shape must enclose a volume"),
    "nearly flat": ("a.obj", FLAT.replace("v 0 1 0", "v 0 1 1e-8"), "", "the mesh is flat"),
    "empty": ("a.stl", "", "", "cannot be read as .stl"),
    "without a triangle": ("a.obj", "v 0 0 0\n", "", "cannot be read as .obj"),
    "cut": ("a.dae", collada()[:600], "", "cannot be read as .dae"),
    "an index that no corner has": ("a.dae", collada(faces=FACES.replace("3", "9")), "", "cannot be read as .dae"),
    "a corner that is no number": (
        "a.obj",
        "v nan 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n",
        "",
        "cannot be",
    ),
    "not of its kind": ("a.stl", "solid\nnonsense", "", "cannot be read as .stl"),
    "of a kind that is not read": ("a.step", "", "", "this kind of file cannot be read; valid: .dae, .obj, .stl"),
    "a unit of no length": ("a.dae", collada('<unit meter="0"/>'), "", "meter of <unit> must be above 0; got '0'"),
    "a negative unit": ("a.dae", collada('<unit meter="-1"/>'), "", "meter of <unit> must be above 0; got '-1'"),
    "a unit that is no number": ("a.dae", collada('<unit meter="mm"/>'), "", "must be above 0; got 'mm'"),
    "the size of a hall": (
        "a.obj",
        BOARD,
        "",
        'is 1000 m long; valid: up to 30 m. If it is in mm, use scale="0.001',
    ),
    "a scale of zero": ("a.obj", FLAT, 'scale="1 0 1"', "a <mesh> of scale 1 0 1; all must be above 0"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_mesh_is_one_error_that_names_link_and_file(name: str, make_plant, tmp_path: Path) -> None:
    file, text, attributes, message = BAD[name]
    (tmp_path / file).write_text(text)
    with pytest.raises(DescriptionError, match="link base: <collision> number 1: ") as error:
        make_plant(ROBOT.format(mesh(tmp_path / file, attributes)), ["j"])
    assert message in str(error.value) and "\n" not in str(error.value)
    assert "scale" in message or file in str(error.value)


@pytest.mark.parametrize(
    "shape",
    [
        '<cylinder radius="0.2" length="0"/>',
        '<cylinder radius="0" length="1"/>',
        '<capsule radius="0.2" length="0"/>',
        '<sphere radius="0"/>',
        '<box size="1 0 1"/>',
        '<box size="1 1e9 1"/>',
    ],
)
def test_a_solid_without_extent_is_refused_as_the_robot_and_as_a_model(shape: str, make_plant) -> None:
    collision = f"<collision><geometry>{shape}</geometry></collision>"
    says = f"<collision> number 1: a {shape.split()[0]}> of .* all must be above 0 and below 1e\\+09"
    with pytest.raises(DescriptionError, match=f"link base: {says}"):
        make_plant(ROBOT.format(collision), ["j"])
    plant = make_plant(ROBOT.format(""), ["j"])
    with pytest.raises(DescriptionError, match=f"link ball: {says}"):
        plant.spawn("ball", THING.format(collision), np.eye(4))
    plant.step()


def test_a_visual_without_extent_does_no_harm(make_plant) -> None:
    make_plant(ROBOT.format('<visual><geometry><box size="0 0 0"/></geometry></visual>'), ["j"]).step()


def test_a_joint_without_a_range_stays_where_it_is(make_plant) -> None:
    urdf = ROBOT.format("").replace('"continuous"', '"revolute"').replace(
        "</joint>", '<axis xyz="0 1 0"/><limit effort="100" velocity="1"/></joint>'
    ).replace("<inertial>", '<inertial><origin xyz="0.1 0 0"/>')  # fmt: skip
    plant = make_plant(urdf, ["j"], [0.0], rotor_inertia=0.0)
    q, dq, tau = [0.0], [0.0], [0.0]
    for _ in range(500):
        plant.step()
    plant.read_state(q, dq, tau)
    assert abs(q[0]) < 0.02
