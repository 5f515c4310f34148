"""Objects in the surroundings of a robot, and pairs of links that are not checked for collision, read from YAML."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import combinations
from pathlib import Path

from hric_control.plant import Surface
from hric_control.plants.surfaces import SurfaceRule, SurfaceSettings
from hric_core.errors import HricError, ParameterError, UnknownNameError
from hric_core.geometry import FloatArray, transform_from_rpy
from hric_core.node import REQUIRED
from hric_core.parameters import Settings, choice, listing, number, numbers, read_yaml, refused, section, text
from hric_core.resources import resolve
from hric_core.urdf import Robot

DENSEST = 2.3e4
"""Largest valid density of an object [kg/m^3]; the densest element, osmium, has 2.26e4."""
SIZES = {
    "box": ("length", "width", "height"),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "plane": (),
    "urdf": (),
}
"""Shapes of objects, and the values in their `size` [m]."""
PLAIN_LINK = "link"
"""Name of the only link of an object that is a simple shape."""
MASKS = "package://hric_control/config/collision_masks.yaml"
"""Default masks."""


@dataclass(frozen=True)
class WorldObject:
    """Object in a world file.

    Attributes:
        name: name, unique in its world.
        shape: a key of SIZES, e.g. "box".
        size: dimensions of the shape, in the order of SIZES [m].
        urdf: URDF file, if the shape is "urdf".
        mass: mass [kg]; 0: the object is fixed in the world.
        T_world_object: pose at the start, shape (4, 4).
        linear, angular: velocity at the start, in the world frame [m/s], [rad/s].
        surface: contact surface.
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


@dataclass(frozen=True)
class _Pose(Settings):
    xyz: tuple[float, ...] = numbers(3, (0.0, 0.0, 0.0), unit="m")
    rpy: tuple[float, ...] = numbers(3, (0.0, 0.0, 0.0), unit="rad")


@dataclass(frozen=True)
class _Velocity(Settings):
    linear: tuple[float, ...] = numbers(3, (0.0, 0.0, 0.0), unit="m/s")
    angular: tuple[float, ...] = numbers(3, (0.0, 0.0, 0.0), unit="rad/s")


@dataclass(frozen=True)
class _Object(SurfaceSettings):
    """Object as written in a world file."""

    name: str = text(empty=False)
    shape: str = choice(*SIZES, default=REQUIRED)
    size: tuple[float, ...] = numbers(default=(), above=0.0, unit="m", single=True)
    urdf: str = text("")
    mass: float = number(0.0, minimum=0.0, unit="kg")
    pose: _Pose = section(_Pose)
    velocity: _Velocity = section(_Velocity)

    def check(self, where: str) -> None:
        """Refuse values that do not fit together: size and shape, a plane with a mass, an impossible density."""
        super().check(where)
        if len(self.size) != len(SIZES[self.shape]):
            raise refused(
                f"{where}size", list(self.size), f"{', '.join(SIZES[self.shape]) or 'none'} of a {self.shape} [m]"
            )
        if self.shape == "plane" and self.mass > 0.0:
            raise refused(f"{where}mass", self.mass, "0: a plane has no mass [kg]")
        if self.urdf and self.shape != "urdf":
            raise ParameterError(f"{where}urdf has no effect on a {self.shape}; valid: {where}shape urdf, or no urdf")
        if self.mass == 0.0 and self.velocity != _Velocity():
            raise ParameterError(f"{where}velocity has no effect without a mass; valid: with {where}mass above 0 [kg]")
        if self.size and self.mass > (heaviest := DENSEST * self._bound):
            grams = f"{self.mass:g} g would be {1e-3 * self.mass:g} kg"
            raise refused(f"{where}mass", self.mass, f"up to {heaviest:.3g} [kg] for this size; {grams}")

    @property
    def _bound(self) -> float:
        """Volume of a box that contains the shape [m^3]."""
        first, last = self.size[0], self.size[-1]
        return math.prod(self.size) if self.shape == "box" else 4.0 * first**2 * (2.0 * first + last)

    def built(self, folder: Path, default_stiffness: float) -> WorldObject:
        """Return the object; `folder`: folder to which relative file names refer."""
        return WorldObject(
            self.name,
            self.shape,
            self.size,
            resolve(self.urdf, folder) if self.shape == "urdf" else None,
            self.mass,
            transform_from_rpy(self.pose.xyz, self.pose.rpy),
            self.velocity.linear,
            self.velocity.angular,
            self.over(Surface(), default_stiffness),
        )


@dataclass(frozen=True)
class _World(Settings):
    objects: tuple[_Object, ...] = listing(section(_Object), default=())
    surfaces: tuple[SurfaceRule, ...] = listing(section(SurfaceRule), default=())

    def check(self, where: str) -> None:
        """Refuse two objects with the same name."""
        names = [item.name for item in self.objects]
        doubles = sorted({name for name in names if names.count(name) > 1})
        if doubles:
            raise ParameterError(f"{where}objects: names must differ; used twice: {', '.join(doubles)}")


def _read(address: str) -> tuple[_World, Path]:
    """Return the content of a world file, and the folder to which its relative file names refer."""
    if not address:
        return _World(), Path()
    try:
        path = resolve(address)
    except UnknownNameError:
        raise
    except HricError as error:
        raise ParameterError(f"plant/world: {error}; valid: a world file by its path or package://") from None
    return _World.of(read_yaml(path), f"{path}:"), path.parent


def load_surfaces(address: str) -> tuple[SurfaceRule, ...]:
    """Return the rules for contact surfaces of links in a world file; `address`: path, package://..., or empty.

    Raises HricError if there is no such file, or a mistake in it."""
    return _read(address)[0].surfaces


def load_world(address: str, default_stiffness: float) -> list[WorldObject]:
    """Return the objects of a world file.

    Args:
        address: path, package://..., or empty for an empty world.
        default_stiffness: stiffness of penalty contact for objects that set none [N/m].

    Raises:
        HricError: no such file, or a mistake in it; the message names the object and the valid choices.
    """
    world, folder = _read(address)
    return [item.built(folder, default_stiffness) for item in world.objects]


@dataclass(frozen=True)
class _Pair(Settings):
    links: tuple[str, str] = listing(text(empty=False), 2)
    reason: str = text(empty=False)


@dataclass(frozen=True)
class _Masks(Settings):
    pairs: tuple[_Pair, ...] = listing(section(_Pair), default=())


def load_masks(address: str) -> list[tuple[str, str]]:
    """Read the pairs of link name patterns that are not checked for collision.

    Args:
        address: path or package://...; empty for the file of this package.

    Raises:
        HricError: an entry is not {links: [pattern, pattern], reason: text}.
    """
    path = resolve(address or MASKS)
    return [pair.links for pair in _Masks.of(read_yaml(path), f"{path}:").pairs]


def never_touching(robot: Robot, masks: Iterable[tuple[str, str]]) -> set[frozenset[str]]:
    """Return the pairs of a robot's links whose collision is not simulated: neighbours, and masked pairs of one arm.

    `masks`: pairs of patterns of link names."""
    known = list(masks)
    pairs = ((a, b) for a, b in combinations(robot.links, 2) if masked(a, b, known))
    return robot.neighbours() | {frozenset(pair) for pair in pairs if not robot.apart(*pair)}


def masked(a: str, b: str, masks: Iterable[tuple[str, str]]) -> bool:
    """Return True if a pair of links matches one of the pairs of patterns, in either order."""
    return any((fnmatchcase(a, x) and fnmatchcase(b, y)) or (fnmatchcase(a, y) and fnmatchcase(b, x)) for x, y in masks)
