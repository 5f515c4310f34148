"""Visible geometry of an OpenSim model at a pose, in the ground frame, for drawing it without a display.

It is read from OpenSim's decorations; OpenSim's own visualizer is not used.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import opensim

from hric_core.errors import DescriptionError, ParameterError, UnknownNameError
from hric_core.geometry import FloatArray, homogeneous
from hric_core.parameters import Settings, flag, number, whole
from urdf_to_osim import transforms

WIREFRAME = 2
"""Value of SimTK::DecorativeGeometry::DrawWireframe."""


@dataclass(frozen=True)
class Decoration:
    """Geometric primitive to draw.

    Attributes:
        kind: "mesh", "sphere", "ellipsoid", "brick", "cylinder" (about y) or "line".
        size: dimensions [m]: half lengths of a brick, radii of a sphere or ellipsoid; radius, half height, radius of a
            cylinder; scale factors of a mesh; coordinates of both ends of a line (6 numbers).
        T_ground: pose in ground, shape (4, 4).
        colour: red, green, blue from 0 to 1.
        opacity: from 0 to 1.
        wireframe: True to draw only edges.
        file: file of a mesh.
    """

    kind: str
    size: tuple[float, ...]
    T_ground: FloatArray
    colour: tuple[float, float, float]
    opacity: float
    wireframe: bool
    file: str = ""


@dataclass(frozen=True)
class Look(Settings):
    """Settings of a picture: size, direction of view, and what is drawn beside the model."""

    width: int = whole(900, minimum=16, maximum=8192, unit="pixel", text="of the picture")
    height: int = whole(900, minimum=16, maximum=8192, unit="pixel", text="of the picture")
    azimuth: float = number(40.0, unit="deg", text="of the camera about the vertical, from x towards the left of x")
    elevation: float = number(15.0, minimum=-90.0, maximum=90.0, unit="deg", text="of the camera above the floor")
    centres: bool = flag(True, text="quartered balls at the centres of mass, drawn over everything")
    frames: bool = flag(False, text="axes of the bodies")


@dataclass(frozen=True)
class DecoratedModel:
    """Visible geometry, body frames and centres of mass of a model at a pose, all in ground.

    Attributes:
        decorations: geometry of the model's components.
        centres: pose of each body's axes at its centre of mass, shape (4, 4), by body; bodies without mass are left
            out.
        frames: pose of each body's frame, shape (4, 4), by body.
        up: unit vector against gravity, shape (3,).
        missing: mesh files that were not found.
    """

    decorations: list[Decoration]
    centres: dict[str, FloatArray]
    frames: dict[str, FloatArray]
    up: FloatArray
    missing: list[str]


def load_scene(path: Path, pose: Mapping[str, float] | None = None) -> DecoratedModel:
    """Load a model, set its pose, and return its visible geometry.

    Args:
        path: .osim file; OpenSim searches its meshes in the folder Geometry/ next to it, among others.
        pose: values of coordinates by name [rad or m]; other coordinates have the model's default values.

    Raises:
        DescriptionError: OpenSim cannot read the file or build the model.
        UnknownNameError: the pose names a coordinate that does not exist.
        ParameterError: the pose has an impossible value.
    """
    if not path.is_file():
        raise DescriptionError(f"no file {path}")
    with transforms.quiet():
        try:
            model = opensim.Model(str(path))
            model.finalizeConnections()
            state = model.initSystem()
        except RuntimeError as error:
            raise DescriptionError(f"OpenSim cannot read {path}: {str(error).splitlines()[0]}") from error
        _set_pose(model, state, pose or {})
        model.realizeVelocity(state)
        decorations, missing = _decorations(model, state)
        centres, frames = _bodies(model, state)
        gravity = model.getGravity().to_numpy()
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 1.0, 0.0])
    return DecoratedModel(decorations, centres, frames, up, missing)


def _set_pose(model: Any, state: Any, pose: Mapping[str, float]) -> None:
    coordinates = model.getCoordinateSet()
    names = [coordinates.get(i).getName() for i in range(coordinates.getSize())]
    for name, value in pose.items():
        if name not in names:
            raise UnknownNameError("coordinate", name, names, "the model")
        if not np.isfinite(value):
            raise ParameterError(f"coordinate {name}: {value} is not a finite number")
        coordinates.get(name).setValue(state, float(value), False)
        if coordinates.get(name).getValue(state) != value:
            raise ParameterError(f"coordinate {name} cannot be {value:g}: the model locks it")
    if model.getConstraintSet().getSize():
        try:
            model.assemble(state)
        except RuntimeError as error:
            raise ParameterError(
                f"the model's constraints cannot be satisfied at this pose: {str(error).splitlines()[0]}"
            ) from error


def _bodies(model: Any, state: Any) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return the poses in ground of the centres of mass and of the body frames, both by body."""
    centres, frames = {}, {}
    bodies = model.getBodySet()
    for i in range(bodies.getSize()):
        body = bodies.get(i)
        T_ground_body = transforms.matrix(body.getTransformInGround(state))
        frames[body.getName()] = T_ground_body
        if body.getMass() > 0.0:
            centres[body.getName()] = T_ground_body @ homogeneous(np.eye(3), body.getMassCenter().to_numpy())
    return centres, frames


def _decorations(model: Any, state: Any) -> tuple[list[Decoration], list[str]]:
    """Return the visible geometry of all components, and the mesh files that were not found."""
    visitor = _Visitor(model, state)
    missing = []
    hints = model.getDisplayHints()
    for component in model.getComponentsList():
        before = len(visitor.decorations)
        for fixed in (True, False):
            geometry = opensim.ArrayDecorativeGeometry()
            component.generateDecorations(fixed, hints, state, geometry)
            for i in range(geometry.size()):
                geometry.at(i).implementGeometry(visitor)
        if component.getConcreteClassName() == "Mesh" and len(visitor.decorations) == before:
            missing.append(opensim.Mesh.safeDownCast(component).get_mesh_file())
    return visitor.decorations, missing


class _Visitor(opensim.DecorativeGeometryImplementation):
    """Visitor that stores each decoration of a model as a `Decoration`; text, points and frames are left out."""

    def __init__(self, model: Any, state: Any) -> None:
        super().__init__()
        self.decorations: list[Decoration] = []
        self._poses = {0: np.eye(4)}  # by mobilized body; 0 is ground
        bodies = model.getBodySet()
        for i in range(bodies.getSize()):
            self._poses[bodies.get(i).getMobilizedBodyIndex()] = transforms.matrix(
                bodies.get(i).getTransformInGround(state)
            )

    def _add(self, geometry: Any, kind: str, size: tuple[float, ...], file: str = "") -> None:
        factors = geometry.getScaleFactors().to_numpy()
        T_ground = self._poses[geometry.getBodyId()] @ transforms.matrix(geometry.getTransform())
        if kind != "line":
            size = tuple(float(x * factor) for x, factor in zip(size, factors, strict=True))
        colour = geometry.getColor().to_numpy()
        opacity = geometry.getOpacity()
        known = (float(colour[0]), float(colour[1]), float(colour[2])) if colour.min() >= 0.0 else (1.0, 1.0, 1.0)
        wireframe = geometry.getRepresentation() == WIREFRAME
        self.decorations.append(
            Decoration(kind, size, T_ground, known, opacity if opacity >= 0.0 else 1.0, wireframe, file)
        )

    def implementMeshFileGeometry(self, geometry: Any) -> None:
        """Store a mesh with the file that OpenSim found."""
        self._add(geometry, "mesh", (1.0, 1.0, 1.0), geometry.getMeshFile())

    def implementSphereGeometry(self, geometry: Any) -> None:
        """Store a sphere."""
        self._add(geometry, "sphere", (geometry.getRadius(),) * 3)

    def implementEllipsoidGeometry(self, geometry: Any) -> None:
        """Store an ellipsoid."""
        self._add(geometry, "ellipsoid", tuple(geometry.getRadii().to_numpy()))

    def implementBrickGeometry(self, geometry: Any) -> None:
        """Store a box."""
        self._add(geometry, "brick", tuple(geometry.getHalfLengths().to_numpy()))

    def implementCylinderGeometry(self, geometry: Any) -> None:
        """Store a cylinder about y."""
        self._add(geometry, "cylinder", (geometry.getRadius(), geometry.getHalfHeight(), geometry.getRadius()))

    def implementLineGeometry(self, geometry: Any) -> None:
        """Store a line, e.g. a segment of a muscle's path."""
        self._add(geometry, "line", (*geometry.getPoint1().to_numpy(), *geometry.getPoint2().to_numpy()))

    def _leave_out(self, geometry: Any) -> None:
        """Ignore text, points, frames and similar geometry."""

    implementArrowGeometry = implementCircleGeometry = implementConeGeometry = implementFrameGeometry = _leave_out
    implementMeshGeometry = implementPointGeometry = implementTextGeometry = implementTorusGeometry = _leave_out
