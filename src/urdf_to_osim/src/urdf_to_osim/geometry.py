"""Mesh files in the folder Geometry/, and the geometry in the model that refers to them."""

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import opensim

from hric_core.errors import DescriptionError
from hric_core.kept import write_whole
from hric_core.processes import uninterrupted
from urdf_to_osim import transforms
from urdf_to_osim.converter import Conversion
from urdf_to_osim.meshes import MeshRequest, convert_meshes
from urdf_to_osim.shapes import OsimShape, attach

FACETS = 64
"""Number of facets of a cylinder or capsule that becomes a contact mesh (project default, unconfirmed).

Between the edges its radius is then 0.12 % too small.
"""


@dataclass(frozen=True)
class MeshFiles:
    """Mesh files that were written: bare names, and the time that it took [s]."""

    files: tuple[str, ...]
    seconds: float


def lay(conversion: Conversion, folder: Path, cache: Path | None = None) -> MeshFiles:
    """Convert the meshes of a conversion into a folder, and let the model in memory refer to these files.

    May be called again for another folder.

    Args:
        conversion: result of the conversion.
        folder: folder for the mesh files.
        cache: folder of converted meshes; None: the default of `convert_meshes`.

    Raises:
        DescriptionError: a mesh is missing, cannot be read, or has no closed surface for contact; names the link.
    """
    meshes = [shape for shape in conversion.meshes if shape.kind == "mesh"]
    if not conversion.meshes:
        return MeshFiles((), 0.0)
    source = Path(conversion.options.folder).resolve() if conversion.options.folder else None
    results = convert_meshes([_request(shape, source) for shape in meshes], folder, cache, source)
    files = {shape.name: result.file for shape, result in zip(meshes, results, strict=True)}
    files |= {shape.name: _write_primitive(shape, folder) for shape in conversion.meshes if shape.kind != "mesh"}
    conversion.geometry.update(files)
    refer(conversion, folder.resolve())
    return MeshFiles(tuple(sorted(set(files.values()))), sum(result.seconds for result in results))


def refer(conversion: Conversion, folder: Path | None) -> None:
    """Let the model refer to mesh files by their path in a folder, or by their bare name if `folder` is None.

    OpenSim searches files with a bare name in the folder Geometry/ next to the model.

    Raises:
        DescriptionError: a surface for contact is not closed; names the link.
    """
    if not conversion.attached:
        # A mesh logs that it has no model yet; an exception before OpenSim's Python code notes that the model owns the
        # mesh would have both delete it.
        with transforms.quiet(), uninterrupted():
            for shape in conversion.meshes:
                conversion.attached[shape.name] = _add(conversion.model, shape, _file(conversion, shape, folder))
            conversion.model.finalizeConnections()
    for shape in conversion.meshes:
        set_file, _ = conversion.attached[shape.name]
        set_file(_file(conversion, shape, folder))


def _file(conversion: Conversion, shape: OsimShape, folder: Path | None) -> str:
    bare = conversion.geometry[shape.name]
    return bare if folder is None else str(folder / bare)


def _request(shape: OsimShape, source: Path | None) -> MeshRequest:
    """Return the request to convert a mesh.

    The file name depends on mesh, scale and source folder, so that links share a file but different robots do not.
    """
    x, y, z = shape.size
    key = hashlib.sha256(f"{source}|{shape.address}|{shape.size}".encode()).hexdigest()[:8]
    stem = re.sub(r"[^A-Za-z0-9_.-]+", "_", Path(shape.address).stem)
    return MeshRequest(shape.link, shape.address, (x, y, z), f"{stem}_{key}")


def _add(model: opensim.Model, shape: OsimShape, file: str) -> tuple[Callable[[str], None], opensim.Component]:
    """Add the geometry of a mesh file to the model; return the function that changes the file, and the geometry."""
    carrier = opensim.PhysicalFrame.safeDownCast(model.updComponent(shape.carrier))
    if shape.visual:
        mesh = opensim.Mesh(file)
        mesh.setName(shape.name)
        attach(carrier, shape, mesh, shape.T_carrier_shape)
        return mesh.set_mesh_file, mesh
    _check_closed(shape, Path(file))
    contact = opensim.ContactMesh(file, *transforms.offset(shape.T_carrier_shape), carrier, shape.name)
    model.addContactGeometry(contact)
    return contact.setFilename, contact


def _check_closed(shape: OsimShape, path: Path) -> None:
    """Raise an error if a mesh is no closed surface, since OpenSim accepts only closed ones as contact geometry."""
    import trimesh

    mesh = trimesh.load_mesh(path, process=False)
    if not (mesh.is_watertight and mesh.is_winding_consistent):
        raise DescriptionError(
            f"link {shape.link}: collision mesh {shape.address!r} is no closed surface, which OpenSim needs for "
            "contact; close it, use its convex hull, or convert without contact"
        )


def _write_primitive(shape: OsimShape, folder: Path) -> str:
    """Write a box, cylinder or capsule as a mesh file and return its name.

    A mesh is used because OpenSim's own contact primitives cannot be in contact with all other shapes.
    """
    import trimesh

    if shape.kind == "box":
        mesh = trimesh.creation.box(extents=shape.size)
    elif shape.kind == "cylinder":
        mesh = trimesh.creation.cylinder(radius=shape.size[0], height=shape.size[1], sections=FACETS)
    else:
        mesh = trimesh.creation.capsule(radius=shape.size[0], height=shape.size[1], count=[FACETS // 2, FACETS // 2])
    text = mesh.export(file_type="obj", digits=9, include_normals=False, header=f"{shape.kind} {shape.size}").encode()
    file = f"{shape.kind}_{hashlib.sha256(text).hexdigest()[:8]}.obj"
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / file, text)
    return file
