"""Worlds: the objects around a robot, from a YAML file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hric_control.errors import HricError
from hric_control.plants.resources import resolve
from hric_control.plants.spatial import FloatArray, transform
from hric_control.plants.surfaces import Surface, SurfaceRule, read_rules, read_surface

SIZES = {
    "box": ("length", "width", "height"),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "plane": (),
    "urdf": (),
}
"""Shapes, and what their size lists [m]."""
PLAIN_LINK = "link"
"""Name of the link of a plain shape."""
_DEFAULTS: dict[str, Any] = {
    "shape": None,
    "size": [],
    "urdf": "",
    "mass": 0.0,
    "pose": {},
    "friction": 0.5,
    "contact": "rigid",
    "stiffness": None,
    "damping": 0.0,
    "velocity": {},
}


@dataclass(frozen=True)
class WorldObject:
    """One object of a world.

    Attributes:
        name: unique in its world.
        shape: a key of SIZES.
        size: see SIZES [m].
        urdf: file, for shape urdf.
        mass: [kg]; 0 is fixed in the world.
        T_world_object: pose at the start, shape (4, 4).
        linear, angular: velocity at the start, world frame [m/s], [rad/s].
        surface: contact law and friction.
    """

    name: str
    shape: str
    size: tuple[float, ...]
    urdf: Path | None
    mass: float
    T_world_object: FloatArray
    linear: tuple[float, ...]
    angular: tuple[float, ...]
    surface: Surface


def _known(values: Any, valid: Mapping[str, Any] | tuple[str, ...], where: str) -> dict[str, Any]:
    if not isinstance(values, dict):
        raise HricError(f"{where}: must be a mapping with the keys {', '.join(valid)}; got {values!r}")
    unknown = sorted(str(key) for key in set(values) - set(valid))
    if unknown:
        raise HricError(f"{where}: unknown key {', '.join(unknown)}; valid: {', '.join(valid)}")
    return values


def _number(value: Any, where: str, least: float = -math.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value < least:
        raise HricError(f"{where}: must be a number" + (f" of at least {least}" if least > -math.inf else "") + f"; got {value!r}")
    return float(value)


def _numbers(value: Any, count: int, where: str) -> tuple[float, ...]:
    values = value if isinstance(value, list) else [value]
    if len(values) != count:
        raise HricError(f"{where}: must be {count} number(s); got {value!r}")
    return tuple(_number(v, where) for v in values)


def _choice(value: Any, valid: Any, where: str) -> str:
    if value not in valid:
        raise HricError(f"{where}: unknown {value!r}; valid: {', '.join(valid)}")
    return str(value)


def _object(item: Any, folder: Path, default_stiffness: float, number: int, where: str) -> WorldObject:
    name = item.get("name") if isinstance(item, dict) else None
    if not isinstance(name, str) or not name:
        raise HricError(f"{where}: object {number} needs a name; got {item!r}")
    where = f"{where}: object {name}"
    data = {**_DEFAULTS, **_known(item, ("name", *_DEFAULTS), where)}
    shape = _choice(data["shape"], SIZES, f"{where}: shape")
    pose = _known(data["pose"], ("xyz", "rpy"), f"{where}: pose")
    velocity = _known(data["velocity"], ("linear", "angular"), f"{where}: velocity")
    size = _numbers(data["size"], len(SIZES[shape]), f"{where}: size ({', '.join(SIZES[shape]) or 'none'})")
    if any(s <= 0.0 for s in size):
        raise HricError(f"{where}: size must be positive; got {data['size']}")
    mass = _number(data["mass"], f"{where}: mass", 0.0)
    if shape == "plane" and mass > 0.0:
        raise HricError(f"{where}: a plane has no mass; got {mass}")
    return WorldObject(
        name,
        shape,
        size,
        resolve(str(data["urdf"]), folder) if shape == "urdf" else None,
        mass,
        transform(_numbers(pose.get("xyz", [0.0] * 3), 3, f"{where}: pose xyz"), _numbers(pose.get("rpy", [0.0] * 3), 3, f"{where}: pose rpy")),
        _numbers(velocity.get("linear", [0.0] * 3), 3, f"{where}: velocity linear"),
        _numbers(velocity.get("angular", [0.0] * 3), 3, f"{where}: velocity angular"),
        read_surface(data, Surface(), default_stiffness, where),
    )


def _contents(path: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise HricError(f"{path}: not YAML: {error}") from error
    return _known(data or {}, ("objects", "surfaces"), str(path))


def load_surfaces(address: str, default_stiffness: float) -> tuple[SurfaceRule, ...]:
    """Rules for the surfaces of single links in a world file; arguments and errors as of `load_world`."""
    if not address:
        return ()
    path = resolve(address)
    return read_rules(_contents(path).get("surfaces") or [], default_stiffness, f"{path}: surfaces")


def load_world(address: str, default_stiffness: float) -> list[WorldObject]:
    """Objects of a world.

    Args:
        address: path, package://..., or "" for an empty world.
        default_stiffness: of penalty contact where the object gives none [N/m].

    Raises:
        HricError: no such file, or a mistake in it; the message names the object and the valid choices.
    """
    if not address:
        return []
    path = resolve(address)
    items = _contents(path).get("objects") or []
    if not isinstance(items, list):
        raise HricError(f"{path}: objects must be a list; got {items!r}")
    objects = [_object(item, path.parent, default_stiffness, i, str(path)) for i, item in enumerate(items, 1)]
    names = [o.name for o in objects]
    doubles = sorted({name for name in names if names.count(name) > 1})
    if doubles:
        raise HricError(f"{path}: object names must differ; twice: {', '.join(doubles)}")
    return objects
