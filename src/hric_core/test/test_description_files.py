"""Robot descriptions from files: meshes with relative paths are found wherever the text is read."""

from pathlib import Path

import pytest

from hric_control.plants import model_of_object
from hric_control.plants.worlds import load_world
from hric_core.errors import DescriptionError
from hric_core.resources import anchored, read_description, resolve
from hric_core.urdf import read

OBJ = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ROBOT = """<robot name="r"><link name="ä"><collision><geometry><mesh filename="{}"/></geometry></collision></link>
</robot>"""


def address_of(text: str) -> str:
    (shape,) = read(text).links["ä"].collisions
    return shape.address


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder with a mesh, which is not the working folder."""
    (tmp_path / "robot/meshes").mkdir(parents=True)
    (tmp_path / "robot/meshes/a b.obj").write_text(OBJ)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    return tmp_path / "robot"


@pytest.mark.parametrize(
    "address", ["meshes/a b.obj", "./meshes/a b.obj", "file://meshes/a%20b.obj", "../robot/meshes/a b.obj"]
)
def test_a_relative_mesh_lies_beside_the_file(address: str, folder: Path) -> None:
    (folder / "r.urdf").write_text(ROBOT.format(address), encoding="utf-8")
    found = resolve(address_of(read_description(Path("../robot/r.urdf"))))
    assert found.resolve() == folder / "meshes/a b.obj"


def test_an_absolute_address_and_one_of_a_package_stay_as_they_are(folder: Path) -> None:
    for address in ("package://p/a.obj", "/somewhere/a.obj", "file:///somewhere/a.obj"):
        assert resolve_free(address_of(anchored(ROBOT.format(address), folder))) == resolve_free(address)


def resolve_free(address: str) -> str:
    return address.removeprefix("file://")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_a_file_is_read_in_the_encoding_that_it_declares(encoding: str, folder: Path) -> None:
    declared = encoding.removesuffix("-sig")
    text = f'<?xml version="1.0" encoding="{declared}"?>{ROBOT.format("meshes/a b.obj")}'
    (folder / "r.urdf").write_bytes(text.encode(encoding))
    assert list(read(read_description(folder / "r.urdf")).links) == ["ä"]


def test_a_model_of_a_world_file_finds_its_meshes_beside_its_own_file(folder: Path) -> None:
    (folder / "r.urdf").write_text(ROBOT.format("meshes/a b.obj"), encoding="utf-8")
    (folder / "world.yaml").write_text("objects:\n- {name: thing, shape: urdf, urdf: r.urdf}\n")
    (item,) = load_world(str(folder / "world.yaml"), 1e4)
    (shape,) = model_of_object(item).tree.links["ä"].collisions
    assert resolve(shape.address) == folder / "meshes/a b.obj"


def test_a_file_that_is_missing_or_no_description_is_one_error_with_its_name(folder: Path) -> None:
    (folder / "cut.urdf").write_text("<robot")
    for name, message in (("cut.urdf", "not XML"), ("none.urdf", "cannot read .*none.urdf: No such file")):
        with pytest.raises(DescriptionError, match=message) as error:
            read_description(folder / name)
        assert "\n" not in str(error.value)
