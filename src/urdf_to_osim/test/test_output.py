"""Files are written completely or not at all; an existing file stays until the new one is complete."""

import signal
from pathlib import Path
from typing import Any

import opensim
import pytest
from small_robots import BODY, link, one_joint, robot

from hric_core.errors import DescriptionError
from urdf_to_osim import Options, convert, geometry, prove, write

FACES = "".join(
    "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {a} {b} {c}\n" for a, b, c in face) + "endloop\nendfacet\n"
    for face in (
        ((0, 0, 0), (0, 1, 0), (1, 0, 0)),
        ((0, 0, 0), (1, 0, 0), (0, 0, 1)),
        ((0, 0, 0), (0, 0, 1), (0, 1, 0)),
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    )
)
TETRAHEDRON = f"solid part\n{FACES}endsolid part\n"
SHOWN = (
    '<visual><geometry><mesh filename="part.stl"/></geometry></visual><collision><geometry><mesh '
    'filename="part.stl"/></geometry></collision>'
)
CONTACT = (
    '<collision><geometry><sphere radius="0.1"/></geometry></collision><collision><geometry><box '
    'size="0.1 0.2 0.3"/></geometry></collision>'
)


def with_mesh(folder: Path) -> tuple[str, Options]:
    (folder / "part.stl").write_text(TETRAHEDRON)
    return robot(link("a", BODY + SHOWN + CONTACT)), Options(contact=True, folder=str(folder))


def test_a_check_that_fails_leaves_nothing_behind_and_an_older_file_as_it_was(tmp_path: Path) -> None:
    def refuse(staged: Path) -> None:
        assert staged.is_file()
        raise DescriptionError("no")

    (tmp_path / "a.osim").write_text("older")
    with pytest.raises(DescriptionError):
        write(convert(one_joint()), tmp_path / "a.osim", refuse)
    assert [path.name for path in tmp_path.iterdir()] == ["a.osim"]
    assert (tmp_path / "a.osim").read_text() == "older"


def test_meshes_lie_in_geometry_and_are_named_without_a_folder(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "target"
    source.mkdir()
    target.mkdir()
    urdf_xml, options = with_mesh(source)
    written = write(convert(urdf_xml, options), target / "a.osim", cache=tmp_path / "cache")
    assert {path.name for path in target.iterdir()} == {"a.osim", "Geometry"}
    assert {path.name for path in (target / "Geometry").iterdir()} == {path.name for path in written.meshes}
    assert len(written.meshes) == 2, "the mesh, shared by what is seen and what touches, and the box"
    text = written.path.read_text()
    assert str(tmp_path) not in text
    assert all(f">{path.name}<" in text for path in written.meshes)


def test_a_model_with_contact_geometry_is_found_again_from_its_file_and_in_memory(tmp_path: Path) -> None:
    urdf_xml, options = with_mesh(tmp_path)
    conversion = convert(urdf_xml, options)
    path = write(conversion, tmp_path / "a.osim").path
    assert prove(path, urdf_xml, options, states=2).passed
    read_back = opensim.Model(str(path))
    for model in (read_back, conversion.model):
        model.initSystem()
        contacts = model.getContactGeometrySet()
        assert [contacts.get(i).getConcreteClassName() for i in range(contacts.getSize())] == [
            "ContactSphere",
            "ContactMesh",
            "ContactMesh",
        ]


def test_a_model_can_be_written_twice(tmp_path: Path) -> None:
    urdf_xml, options = with_mesh(tmp_path)
    conversion = convert(urdf_xml, options)
    (tmp_path / "other").mkdir()
    first, second = write(conversion, tmp_path / "a.osim"), write(conversion, tmp_path / "other" / "a.osim")
    assert first.path.read_text() == second.path.read_text()
    assert [path.read_bytes() for path in first.meshes] == [path.read_bytes() for path in second.meshes]


def test_opensim_writes_no_log_file_into_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    convert(one_joint()).model.initSystem()
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_does_not_leave_a_mesh_with_two_owners(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    xml, options = with_mesh(tmp_path)
    conversion, attach = convert(xml, options), geometry.attach

    def interrupted(*arguments: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        attach(*arguments)

    monkeypatch.setattr(geometry, "attach", interrupted)
    with pytest.raises(KeyboardInterrupt):
        geometry.lay(conversion, tmp_path / "Geometry")
    assert conversion.attached.keys() == {shape.name for shape in conversion.meshes}
