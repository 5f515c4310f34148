"""Reader of the triangles and colours of mesh files: COLLADA (.dae), .obj and .stl."""

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import collada
import numpy as np
import trimesh

from hric_core.meshes.canonical import MeshSurface, UnreadableMeshError

Part = tuple[Any, Any, tuple[float, ...] | None]
"""Vertices, faces and colour (red, green, blue, opacity; None: no colour) of one material."""


LOOKS = (
    "library_effects",
    "library_materials",
    "library_images",
    "library_lights",
    "library_cameras",
    "library_animations",
    "library_controllers",
    "bind_material",
    "instance_camera",
    "instance_light",
    "instance_controller",
)


def read_surface(path: Path, content: bytes, scale: tuple[float, float, float]) -> MeshSurface:
    """Return the triangles of a mesh file, scaled by a URDF's `<mesh scale>`.

    A negative factor mirrors the mesh; its faces still point outwards. In a COLLADA file the transforms of the nodes
    and the unit of length are applied; the `up_axis` is ignored, as in rviz.

    Args:
        path: the file; only its extension is read here.
        content: the bytes of the file.
        scale: factors along the mesh's axes.

    Raises:
        UnreadableMeshError: the content is not a mesh of this type, or has no triangle with an area.
    """
    try:
        dae = path.suffix.lower() == ".dae"
        parts = _read_collada(_without_looks(content)) if dae else _read_plain(path.suffix, content)
    except Exception as error:  # the parsers raise errors of any type
        raise UnreadableMeshError(f"{type(error).__name__}: {error}".splitlines()[0]) from error
    return _joined(parts, scale)


def read_coloured(
    path: Path, content: bytes, scale: tuple[float, float, float]
) -> list[tuple[MeshSurface, tuple[float, ...] | None]]:
    """Return one surface per material colour (red, green, blue, opacity, each 0 to 1; None: no colour).

    Textures are not read. If the materials cannot be read, the result is one surface without a colour. For the
    arguments see `read_surface`.

    Raises:
        UnreadableMeshError: the content is not a mesh of this type, or has no triangle with an area.
    """
    try:
        parts = _read_collada(content) if path.suffix.lower() == ".dae" else _read_obj(path, content)
        colours = sorted({colour for _, _, colour in parts}, key=lambda colour: colour or ())
        return [(_joined([part for part in parts if part[2] == colour], scale), colour) for colour in colours]
    except Exception:  # the parsers raise errors of any type; the shape alone may be readable
        return [(read_surface(path, content, scale), None)]


def _joined(parts: Sequence[Part], scale: tuple[float, float, float]) -> MeshSurface:
    mesh = (
        trimesh.util.concatenate([trimesh.Trimesh(vertices, faces, process=False) for vertices, faces, _ in parts])
        if parts
        else trimesh.Trimesh()
    )
    if len(mesh.faces) and not np.isfinite(mesh.vertices[mesh.faces]).all():
        raise UnreadableMeshError("a coordinate is not a finite number")
    return _clean(mesh, scale)


def _read_collada(content: bytes) -> list[Part]:
    """Return vertices [m], faces and diffuse colour of every primitive in the file's scene."""
    document = collada.Collada(io.BytesIO(content), ignore=[collada.common.DaeUnsupportedError])
    metres, unit = document.assetInfo.unitmeter, document.xmlnode.getroot().find("{*}asset/{*}unit[@meter]")
    if unit is not None and not 0.0 < (metres or 0.0) < math.inf:
        raise ValueError(f"meter of <unit> must be above 0; got {unit.get('meter')!r}")
    parts: list[Part] = []
    for geometry in document.scene.objects("geometry") if document.scene else ():
        for primitive in geometry.primitives():
            triangles = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
            indices = getattr(triangles, "vertex_index", None)
            if indices is not None and np.ndim(indices) == 2 and np.shape(indices)[1] == 3:  # lines have pairs
                diffuse = getattr(getattr(primitive.material, "effect", None), "diffuse", None)
                colour = tuple(map(float, diffuse)) if isinstance(diffuse, tuple) else None
                parts.append((np.asarray(triangles.vertex, float) * (metres or 1.0), indices, colour))
    return parts


def _without_looks(content: bytes) -> bytes:
    """Return the COLLADA file without materials, images, lights and cameras, whose references may be broken."""
    root = ElementTree.fromstring(content)
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag.rpartition("}")[2] in LOOKS:
                parent.remove(child)
    return ElementTree.tostring(root)


def _read_obj(path: Path, content: bytes) -> list[Part]:
    """Return vertices, faces and diffuse colour per material of an .obj file with its .mtl; an .stl file has none."""
    if path.suffix.lower() != ".obj":
        return _read_plain(path.suffix, content)
    resolver = trimesh.resolvers.FilePathResolver(str(path))
    loaded = trimesh.load_scene(io.BytesIO(content), file_type="obj", resolver=resolver, process=False)
    parts: list[Part] = []
    for mesh in loaded.geometry.values():
        diffuse = getattr(getattr(mesh.visual, "material", None), "diffuse", None)
        colour = None if diffuse is None else tuple(float(value) / 255.0 for value in diffuse)
        parts.append((mesh.vertices, mesh.faces, colour))
    return parts


def _read_plain(suffix: str, content: bytes) -> list[Part]:
    """Return vertices and faces of an .stl or .obj file, which have no unit and no transforms."""
    options = {"skip_materials": True} if suffix.lower() == ".obj" else {}
    mesh = trimesh.load_mesh(io.BytesIO(content), file_type=suffix[1:].lower(), process=False, **options)
    return [(mesh.vertices, mesh.faces, None)]


def _clean(mesh: Any, scale: tuple[float, float, float]) -> MeshSurface:
    """Scale a mesh, merge equal vertices and drop faces without area, as contact needs closed surfaces."""
    mesh.apply_transform(np.diag([*scale, 1.0]))
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    mesh.remove_unreferenced_vertices()
    if not len(mesh.faces):
        raise UnreadableMeshError("it has no triangle with an area")
    return MeshSurface(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64))
