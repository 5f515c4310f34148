"""Off-screen rendering of an OpenSim model by VTK, without X server and window; a graphics card is not necessary."""

import ctypes
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType  # noqa: F401  draws the letters
from vtkmodules import vtkFiltersSources as sources
from vtkmodules import vtkRenderingCore as rendering
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals, vtkTubeFilter
from vtkmodules.vtkIOGeometry import vtkOBJReader, vtkSTLReader
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader
from vtkmodules.vtkRenderingOpenGL2 import vtkEGLRenderWindow

from hric_core.errors import FailureError, HricError
from hric_core.geometry import FloatArray
from urdf_to_osim.decorations import DecoratedModel, Decoration, Look

READERS = {".obj": vtkOBJReader, ".stl": vtkSTLReader, ".vtp": vtkXMLPolyDataReader}
AXES = ((0.85, 0.15, 0.15), (0.1, 0.6, 0.15), (0.15, 0.3, 0.85))
"""Colours of the axes x, y, z."""
BALL, AXIS, LINE = 0.022, 0.3, 0.003
"""Radius of the ball at a centre of mass, and length of ground's axes, as fractions of the scene's radius [1].

LINE: radius of a muscle's line [m].
"""
BACKGROUND, GRID = (0.92, 0.94, 0.96), (0.75, 0.77, 0.8)
VIEW_ANGLE, MARGIN = 20.0, 0.05
"""Vertical view angle of the camera [deg], and free margin at the edges as a fraction of the picture [1]."""


def draw(scene: DecoratedModel, look: Look) -> bytes:
    """Return a PNG image of a model at a pose.

    Raises:
        HricError: this machine cannot render off-screen (EGL is missing), or a mesh cannot be read.
    """
    window = _window(look)
    solid, over = rendering.vtkRenderer(), rendering.vtkRenderer()
    window.SetNumberOfLayers(2)
    for layer, renderer in enumerate((solid, over)):
        renderer.SetLayer(layer)
        window.AddRenderer(renderer)
    solid.SetBackground(*BACKGROUND)
    over.SetActiveCamera(solid.GetActiveCamera())
    for decoration in scene.decorations:
        solid.AddActor(_actor_of(decoration))
    bounds = _bounds(solid, scene)
    radius = float(np.linalg.norm(bounds[1] - bounds[0])) / 2.0
    _add_floor(solid, scene.up, bounds, radius)
    _add_axes(over, np.eye(4), AXIS * radius, letters=True)
    for T_ground_body in scene.frames.values() if look.frames else ():
        _add_axes(over, T_ground_body, AXIS * radius / 4.0)
    for T_ground_centre in scene.centres.values() if look.centres else ():
        over.AddActor(_ball(T_ground_centre, BALL * radius))
    _aim(solid, scene.up, bounds, look)
    return _png(window)


def _window(look: Look) -> Any:
    """Return an off-screen render window that needs no display; without EGL VTK would crash, so it is checked first."""
    need = (
        "pictures are rendered through EGL, which Debian's packages libegl1 and libgl1-mesa-dri provide "
        "(scripts/setup installs them)"
    )
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        raise FailureError(f"{need}: {error}") from error
    window = vtkEGLRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(look.width, look.height)
    window.SetMultiSamples(8)
    if not window.SupportsOpenGL():
        raise FailureError(f"{need}; the EGL of this machine does not support OpenGL")
    return window


def _aim(renderer: Any, up: FloatArray, bounds: FloatArray, look: Look) -> None:
    """Place camera and lamp so that the scene's bounding box just fits into the picture."""
    forwards, left = _floor_axes(up)
    azimuth, elevation = math.radians(look.azimuth), math.radians(look.elevation)
    sideways = math.cos(azimuth) * forwards + math.sin(azimuth) * left
    towards = math.cos(elevation) * sideways + math.sin(elevation) * up
    upwards = math.cos(elevation) * up - math.sin(elevation) * sideways
    focus = bounds.mean(axis=0)
    corners = (
        np.array([[bounds[i][0], bounds[j][1], bounds[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) - focus
    )
    slope = math.tan(math.radians(VIEW_ANGLE / 2.0))
    aside = np.maximum(
        np.abs(corners @ upwards), np.abs(corners @ np.cross(upwards, towards)) * look.height / look.width
    )
    distance = float(np.max(corners @ towards + (1.0 + MARGIN) * aside / slope))
    camera = renderer.GetActiveCamera()
    camera.SetFocalPoint(*focus)
    camera.SetPosition(*(focus + distance * towards))
    camera.SetViewUp(*upwards)
    camera.SetViewAngle(VIEW_ANGLE)
    renderer.ResetCameraClippingRange()


def _floor_axes(up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two orthogonal unit vectors in the floor plane: ground's x (or z if x points up), and left of it."""
    start = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[2]
    forwards = start - (start @ up) * up
    forwards /= np.linalg.norm(forwards)
    return forwards, np.cross(up, forwards)


def _bounds(renderer: Any, scene: DecoratedModel) -> FloatArray:
    """Return the minimum and maximum coordinates of all geometry and the origin, shape (2, 3) [m]."""
    points = [np.zeros(3), *(T[:3, 3] for T in scene.frames.values()), *(T[:3, 3] for T in scene.centres.values())]
    if scene.decorations:
        drawn = np.array(renderer.ComputeVisiblePropBounds()).reshape(3, 2)
        points += [drawn[:, 0], drawn[:, 1]]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return np.array([low, np.maximum(high, low + 1e-3)])


def _actor_of(decoration: Decoration) -> Any:
    actor = _actor(_source(decoration), decoration.colour)
    T = decoration.T_ground if decoration.kind == "line" else decoration.T_ground @ np.diag([*decoration.size, 1.0])
    actor.SetUserMatrix(_matrix(T))
    looks = actor.GetProperty()
    looks.SetOpacity(decoration.opacity)
    if decoration.wireframe:
        looks.SetRepresentationToWireframe()
    return actor


def _source(decoration: Decoration) -> Any:
    """Return a VTK source of a decoration's shape at unit size."""
    if decoration.kind == "mesh":
        return _mesh(Path(decoration.file))
    if decoration.kind == "line":
        return _tube(decoration.size[:3], decoration.size[3:], LINE)
    if decoration.kind == "brick":
        return sources.vtkCubeSource(x_length=2.0, y_length=2.0, z_length=2.0)
    if decoration.kind == "cylinder":
        return sources.vtkCylinderSource(height=2.0, radius=1.0, resolution=48)
    return _sphere()


def _mesh(path: Path) -> Any:
    """Return a VTK source of a mesh file; edges of more than 30 degrees are shaded as sharp ones."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise HricError(f"mesh {path}: cannot be drawn; valid: {', '.join(READERS)}")
    source: Any = reader(file_name=str(path))
    return vtkPolyDataNormals(input_connection=source.GetOutputPort(), feature_angle=30.0)


def _sphere() -> Any:
    # 32 steps both ways: edges lie on the planes between octants.
    return sources.vtkSphereSource(radius=1.0, theta_resolution=32, phi_resolution=33)


def _tube(start: Sequence[float] | FloatArray, end: Sequence[float] | FloatArray, radius: float) -> Any:
    line = sources.vtkLineSource(point1=tuple(start), point2=tuple(end))
    return vtkTubeFilter(input_connection=line.GetOutputPort(), radius=radius, number_of_sides=12)


def _ball(T_ground: FloatArray, radius: float) -> Any:
    """Return the symbol of a centre of mass: a sphere with alternating black and white octants."""
    source = _sphere()
    source.Update()
    ball = vtkPolyData()
    ball.ShallowCopy(source.GetOutput())
    faces = vtk_to_numpy(ball.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    middles = vtk_to_numpy(ball.GetPoints().GetData())[faces].mean(axis=1)
    shade = np.where(middles.prod(axis=1) > 0.0, 20, 255).astype(np.uint8)
    ball.GetCellData().SetScalars(numpy_to_vtk(np.repeat(shade[:, None], 3, axis=1), deep=True))
    mapper = rendering.vtkPolyDataMapper()
    mapper.SetInputData(ball)
    actor = rendering.vtkActor()
    actor.SetMapper(mapper)
    actor.SetUserMatrix(_matrix(T_ground @ np.diag([radius, radius, radius, 1.0])))
    actor.GetProperty().SetAmbient(0.4)
    return actor


def _add_axes(renderer: Any, T_ground: FloatArray, length: float, *, letters: bool = False) -> None:
    """Draw the axes of a frame, x red, y green, z blue."""
    for axis, (colour, letter) in enumerate(zip(AXES, "xyz", strict=True)):
        end = T_ground[:3, 3] + length * T_ground[:3, axis]
        bar = _actor(_tube(T_ground[:3, 3], end, length / 40.0), colour)
        bar.GetProperty().SetAmbient(0.5)
        renderer.AddActor(bar)
        if letters:
            text = rendering.vtkBillboardTextActor3D()
            text.SetInput(letter)
            text.SetPosition(*(end + 0.1 * length * T_ground[:3, axis]))
            text.GetTextProperty().SetColor(*colour)
            text.GetTextProperty().SetFontSize(28)
            text.GetTextProperty().BoldOn()
            renderer.AddActor(text)


def _add_floor(renderer: Any, up: FloatArray, bounds: FloatArray, radius: float) -> None:
    """Draw a grid through ground's origin, normal to gravity, with squares of 0.1 m or another power of ten."""
    step = 10.0 ** round(math.log10(radius / 8.0))
    forwards, left = _floor_axes(up)
    middle = bounds.mean(axis=0)
    cells = 2 * math.ceil(0.8 * radius / step)
    first, second = ((round(float(middle @ axis) / step) - cells / 2) * step * axis for axis in (forwards, left))
    corner = first + second
    plane = sources.vtkPlaneSource()
    plane.SetOrigin(*corner)
    plane.SetPoint1(*(corner + cells * step * forwards))
    plane.SetPoint2(*(corner + cells * step * left))
    plane.SetResolution(cells, cells)
    actor = _actor(plane, GRID)
    actor.GetProperty().SetRepresentationToWireframe()
    actor.GetProperty().LightingOff()
    renderer.AddActor(actor)


def _actor(source: Any, colour: tuple[float, float, float]) -> Any:
    mapper = rendering.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor = rendering.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*colour)
    actor.GetProperty().SetAmbient(0.15)
    return actor


def _matrix(T: FloatArray) -> Any:
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(np.asarray(T, float).ravel().tolist())
    return matrix


def _png(window: Any) -> bytes:
    window.Render()
    grab = rendering.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.SetInputBufferTypeToRGB()
    grab.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    writer.WriteToMemoryOn()
    writer.Write()
    return bytes(vtk_to_numpy(writer.GetResult()).tobytes())
