"""Meshes in the OpenSim model have the shape of their files."""

import os
import subprocess
import sys
from pathlib import Path

import coal
import numpy as np
import opensim
import pybullet_data
import pytest

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.meshes.canonical import MeshSurface
from hric_core.meshes.files import read_coloured, read_surface
from urdf_to_osim.meshes import MeshRequest, MeshResult, convert_meshes, write_whole

DATA = Path(pybullet_data.getDataPath())
SCALE = (1.0, 1.0, 1.0)
TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
OBJ = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
# One tetrahedron; its node is turned by 90 degrees about z and then shifted; unit, up axis and material are filled in.
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit meter="{unit}" name="u"/><up_axis>{up}</up_axis></asset>
  {library}
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array>
      <technique_common><accessor source="#a" count="4" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="4" material="m"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s">
    <node id="outer"><translate>10 20 30</translate><node id="inner"><rotate>0 0 1 90</rotate>
      <instance_geometry url="#g">{binding}</instance_geometry></node></node>
  </visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""  # noqa: E501
MISSING_TEXTURE = """<library_effects><effect id="e"><profile_COMMON><newparam sid="x"><sampler2D><source>nothing</source></sampler2D></newparam>
  <technique sid="t"><lambert><diffuse><texture texture="x" texcoord="UV"/></diffuse></lambert></technique>
  </profile_COMMON></effect></library_effects>
  <library_materials><material id="m0"><instance_effect url="#e"/></material></library_materials>"""  # noqa: E501
BLUE = """<library_effects><effect id="e"><profile_COMMON>
  <technique sid="t"><lambert><diffuse><color>0 0.5 1 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
  <library_materials><material id="m0"><instance_effect url="#e"/></material></library_materials>"""  # noqa: E501
BINDING = (
    '<bind_material><technique_common><instance_material symbol="m" target="#m0"/></technique_common></bind_material>'
)


def collada(unit: float = 1.0, up: str = "Z_UP", library: str = "", binding: str = "") -> bytes:
    return DAE.format(unit=unit, up=up, library=library, binding=binding).encode()


def volume(surface: MeshSurface) -> float:
    """Return the signed volume: positive if the faces are counter-clockwise seen from outside [m^3]."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def moved(unit: float) -> FloatArray:
    """Return the tetrahedron at the place that the file's nodes give [m]."""
    turned = np.column_stack([-TETRAHEDRON[:, 1], TETRAHEDRON[:, 0], TETRAHEDRON[:, 2]])
    return (turned + np.array([10.0, 20.0, 30.0])) * unit


def request(address: object, scale: tuple[float, float, float] = SCALE, file: str = "out") -> MeshRequest:
    return MeshRequest("forearm", str(address), scale, file)


def rows(points: FloatArray) -> list[tuple[float, ...]]:
    return sorted(tuple(row) for row in points.round(9).tolist())


@pytest.mark.parametrize("unit", [1.0, 0.0254, 0.001])
@pytest.mark.parametrize("up", ["Z_UP", "Y_UP"])
def test_a_collada_file_keeps_its_transforms_and_its_unit_and_is_not_turned_by_its_up_axis(
    unit: float, up: str
) -> None:
    surface = read_surface(Path("a.dae"), collada(unit, up), SCALE)
    assert rows(surface.vertices) == rows(moved(unit))
    assert volume(surface) == pytest.approx(1.0 * unit**3)


def test_a_collada_file_keeps_its_shape_when_a_texture_is_missing() -> None:
    surface = read_surface(Path("a.dae"), collada(library=MISSING_TEXTURE, binding=BINDING), SCALE)
    assert rows(surface.vertices) == rows(moved(1.0))


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (1.0, 0.5, 0.1), (-1.0, 1.0, 1.0), (-1.0, -2.0, -3.0)])
def test_a_scale_acts_along_the_axes_and_a_mirrored_mesh_keeps_its_outside_outside(
    scale: tuple[float, float, float],
) -> None:
    surface = read_surface(Path("a.obj"), OBJ.encode(), scale)
    assert rows(surface.vertices) == rows(TETRAHEDRON * scale)
    assert volume(surface) == pytest.approx(abs(np.prod(scale)))


def unit_of(path: Path) -> float:
    """Return the unit from the text of the file, which the reader used as a reference ignores."""
    text = path.read_text(errors="ignore") if path.suffix == ".dae" else ""
    return float(text.split('meter="', 1)[1].split('"', 1)[0]) if 'meter="' in text else 1.0


FILES = [
    *(
        f"franka_panda/meshes/{name}.obj"
        for name in ("collision/link0", "visual/link1", "visual/link6", "visual/hand", "visual/finger")
    ),
    *("duck.dae", "racecar/meshes/cone.dae", "racecar/meshes/chassis.dae", "racecar/meshes/hokuyo.dae"),
    *("kuka_iiwa/meshes/link_1.stl", "kuka_iiwa/meshes/link_7.stl"),
]


@pytest.mark.parametrize("name", FILES)
def test_a_shipped_mesh_has_the_bounds_that_another_library_reads_from_the_source(name: str, tmp_path: Path) -> None:
    source = DATA / name
    reference = np.array(coal.MeshLoader().load(str(source), np.ones(3)).vertices()) * unit_of(source)
    (result,) = convert_meshes([request(source)], tmp_path / "Geometry", tmp_path / "cache")
    written = np.array(
        [
            line.split()[1:]
            for line in (tmp_path / "Geometry" / result.file).read_text().splitlines()
            if line.startswith("v ")
        ],
        float,
    )
    size = np.ptp(reference, axis=0).max()
    assert np.allclose(written.min(axis=0), reference.min(axis=0), atol=1e-6 * size)
    assert np.allclose(written.max(axis=0), reference.max(axis=0), atol=1e-6 * size)


def test_opensim_reads_what_is_written(tmp_path: Path) -> None:
    source = tmp_path / "a.dae"
    source.write_bytes(collada())
    (result,) = convert_meshes([request(source)], tmp_path / "Geometry", tmp_path / "cache")
    mesh = opensim.PolygonalMesh()
    mesh.loadFile(str(tmp_path / "Geometry" / result.file))
    assert (mesh.getNumFaces(), mesh.getNumVertices()) == (4, 4)
    positions = [mesh.getVertexPosition(i) for i in range(4)]
    assert rows(np.array([[position.get(k) for k in range(3)] for position in positions])) == rows(moved(1.0))


def test_a_mesh_is_converted_once_and_again_when_its_content_or_scale_changes(tmp_path: Path) -> None:
    source = tmp_path / "a.obj"
    source.write_text(OBJ)

    def convert(scale: tuple[float, float, float] = SCALE) -> MeshResult:
        return convert_meshes([request(source, scale)], tmp_path / "Geometry", tmp_path / "cache")[0]

    first, second = convert(), convert()
    assert (first.cached, second.cached) == (False, True)
    once = (tmp_path / "Geometry/out.obj").read_bytes()
    assert not convert((2.0, 2.0, 2.0)).cached
    assert (tmp_path / "Geometry/out.obj").read_bytes() != once
    source.write_text(OBJ.replace("v 0 0 3", "v 0 0 4"))
    assert not convert().cached
    assert "v 0 0 4" in (tmp_path / "Geometry/out.obj").read_text()


def test_files_with_one_name_in_different_folders_stay_apart(tmp_path: Path) -> None:
    requests = []
    for number in (3, 5):
        source = tmp_path / str(number) / "base.obj"
        source.parent.mkdir()
        source.write_text(OBJ.replace("v 0 0 3", f"v 0 0 {number}"))
        requests.append(request(source, file=f"link{number}"))
    convert_meshes(requests, tmp_path / "Geometry", tmp_path / "cache")
    assert "v 0 0 3" in (tmp_path / "Geometry/link3.obj").read_text()
    assert "v 0 0 5" in (tmp_path / "Geometry/link5.obj").read_text()


def test_addresses_are_found_by_package_by_file_and_beside_the_description(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "some_robot"
    (package / "meshes").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>some_robot</name></package>")
    (package / "meshes/a b.obj").write_text(OBJ)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    addresses = ["package://some_robot/meshes/a%20b.obj", (package / "meshes/a b.obj").as_uri(), "meshes/a b.obj"]
    requests = [request(address, file=f"mesh{i}") for i, address in enumerate(addresses)]
    results = convert_meshes(requests, tmp_path / "Geometry", tmp_path / "cache", relative_to=package)
    assert [result.cached for result in results] == [False, True, True]
    assert sorted(os.listdir(tmp_path / "Geometry")) == ["mesh0.obj", "mesh1.obj", "mesh2.obj"]


def test_a_cache_that_cannot_be_written_costs_only_time(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "file").write_text("not a folder")
    with caplog.at_level("INFO"):
        results = convert_meshes([request(tmp_path / "a.obj")], tmp_path / "Geometry", tmp_path / "file")
    assert (tmp_path / "Geometry" / results[0].file).is_file()
    assert "cache: cannot write" in caplog.text


@pytest.mark.parametrize(
    ("address", "scale", "words"),
    [
        ("/no/such/hand.stl", SCALE, ("/no/such/hand.stl", "leave meshes out")),
        ("package://no_such_package/hand.dae", SCALE, ("no_such_package", "ROS_PACKAGE_PATH")),
        ("http://somewhere/hand.dae", SCALE, ("http://", "file://")),
        ("hand.ply", SCALE, (".dae, .obj, .stl",)),
        ("hand", SCALE, (".dae, .obj, .stl",)),
        ("", SCALE, (".dae, .obj, .stl",)),
        ("hand.stl", (1.0, 0.0, 1.0), ("scale 1 0 1", "other than 0")),
        ("hand.stl", (1.0, float("nan"), 1.0), ("scale 1 nan 1",)),
    ],
)
def test_a_mesh_that_cannot_be_found_gives_one_error_with_link_and_address_and_no_file(
    address: str, scale: tuple[float, float, float], words: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "good.obj").write_text(OBJ)
    with pytest.raises(DescriptionError) as error:
        convert_meshes(
            [request(tmp_path / "good.obj"), request(address, scale)], tmp_path / "Geometry", tmp_path / "cache"
        )
    assert all(word in str(error.value) for word in ("'forearm'", repr(address), *words)), error.value
    assert not (tmp_path / "Geometry").exists()


def test_of_several_missing_meshes_the_first_is_named_and_the_others_are_counted(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=r"one\.stl.*\(2 more meshes have such errors\)"):
        convert_meshes([request(f"/no/{name}.stl") for name in ("one", "two", "three", "one")], tmp_path, tmp_path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.dae", b""),
        ("a.dae", b"<COLLADA>"),
        ("a.dae", collada()[:900]),
        ("a.dae", collada().replace(b'url="#g"', b'url="#h"')),
        ("a.dae", collada().replace(b"<p>0 2 1 0 1 3 0 3 2 1 2 3</p>", b"<p>0 2 1 0 1 3 0 3 2 1 2 9</p>")),
        ("a.stl", b""),
        ("a.stl", b"\x00" * 200),
        ("a.stl", np.random.default_rng(0).bytes(400)),
        ("a.obj", b""),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 nan\nf 1 2 3\n"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n"),
    ],
)
def test_a_file_that_is_no_mesh_gives_one_error_with_link_and_file_and_nothing_is_written(
    name: str, content: bytes, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DescriptionError) as error:
        convert_meshes([request(tmp_path / name)], tmp_path / "Geometry", tmp_path / "cache")
    assert all(
        word in str(error.value) for word in ("'forearm'", str(tmp_path / name), "cannot be read", "leave meshes out")
    )
    assert "\n" not in str(error.value)
    assert list((tmp_path / "Geometry").iterdir()) == []
    assert not (tmp_path / "cache").exists()


def test_a_file_that_cannot_be_put_in_place_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "target").mkdir()
    with pytest.raises(OSError, match="target"):
        write_whole(tmp_path / "target", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["target"]


def test_a_kept_conversion_that_was_damaged_is_made_again(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    requests, cache, written = [request(tmp_path / "a.obj")], tmp_path / "cache", tmp_path / "Geometry/out.obj"
    convert_meshes(requests, tmp_path / "Geometry", cache)
    whole = written.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], whole.replace(b"3", b"4")):
        (kept,) = cache.iterdir()
        kept.write_bytes(damaged)
        assert not convert_meshes(requests, tmp_path / "Geometry", cache)[0].cached
        assert written.read_bytes() == whole and [path.read_bytes() for path in cache.iterdir()] == [whole]


def test_processes_that_convert_the_same_meshes_at_once_all_get_them_whole(tmp_path: Path) -> None:
    paths = [DATA / f"franka_panda/meshes/visual/{name}.obj" for name in ("finger", "hand", "link1")]
    code = (
        "import sys; from pathlib import Path; from urdf_to_osim.meshes import convert_meshes; from "
        "urdf_to_osim.meshes import MeshRequest\n"
        "folder, cache, *files = map(Path, sys.argv[1:])\n"
        "convert_meshes([MeshRequest('hand', str(file), (1.0, 1.0, 1.0), file.stem) for file in files], folder, cache)"
    )
    command = [sys.executable, "-c", code]
    # Two of them into one folder, as two conversions beside each other do.
    folders = [tmp_path / name for name in ("one", "one", "two", "three")]
    children = [
        subprocess.Popen([*command, str(folder), str(tmp_path / "cache"), *map(str, paths)]) for folder in folders
    ]
    assert [child.wait(timeout=100) for child in children] == [0] * len(children)
    for path in paths:
        assert len({(folder / path.name).read_bytes() for folder in folders}) == 1
    assert len(list((tmp_path / "cache").iterdir())) == len(paths), "one file a mesh, and nothing that was begun"
    assert all(
        result.cached
        for result in convert_meshes([request(path) for path in paths], tmp_path / "four", tmp_path / "cache")
    )


def test_without_a_home_meshes_are_converted_and_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable, value in (("XDG_CACHE_HOME", "relative"), ("HOME", "nowhere")):
        monkeypatch.setenv(variable, value)
    (tmp_path / "a.obj").write_text(OBJ)
    monkeypatch.chdir(tmp_path)
    assert not convert_meshes([request(tmp_path / "a.obj")], tmp_path / "Geometry")[0].cached
    assert sorted(path.name for path in tmp_path.iterdir()) == ["Geometry", "a.obj"]


def test_a_mesh_comes_apart_by_the_colours_of_its_materials(tmp_path: Path) -> None:
    (tmp_path / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl grey\nKd 0.25 0.25 0.25\n")
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))
    text = f"mtllib two.mtl\n{corners}usemtl red\nf 1 2 3\nusemtl grey\nf 1 2 4\nf 1 3 4\n"
    found = read_coloured(tmp_path / "two.obj", text.encode(), (1.0, 1.0, 1.0))
    assert [(len(surface.faces), np.round(colour or (), 2).tolist()) for surface, colour in found] == [
        (2, [0.25, 0.25, 0.25, 1.0]),
        (1, [1.0, 0.0, 0.0, 1.0]),
    ]


def test_a_collada_file_gives_its_diffuse_colour() -> None:
    content = collada(library=BLUE, binding=BINDING)
    ((surface, colour),) = read_coloured(Path("a.dae"), content, SCALE)
    assert colour == (0.0, 0.5, 1.0, 1.0)
    assert np.array_equal(surface.vertices, read_surface(Path("a.dae"), content, SCALE).vertices)


def test_a_mesh_whose_materials_are_gone_is_one_surface_without_a_colour(tmp_path: Path) -> None:
    text = "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
    ((surface, colour),) = read_coloured(tmp_path / "one.obj", text.encode(), (2.0, 1.0, 1.0))
    assert colour is None and surface.vertices.max() == 2.0
