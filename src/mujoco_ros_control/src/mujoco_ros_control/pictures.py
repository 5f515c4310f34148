"""Camera images of the robot and the world, rendered by MuJoCo from their descriptions at given poses.

No physics is simulated here, so the images can show the robot of any engine, or the real one. The camera looks along
x of its own frame, with z up (REP 103); images are in the optical frame: x right, y down, z ahead.
"""

import importlib
import math
import os
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from hric_control.plants import Model, load_world, model_of_object
from hric_core.errors import DescriptionError, HricError, check_known
from hric_core.geometry import FloatArray, homogeneous, transform_from_rpy
from hric_core.meshes.canonical import UnreadableMeshError, find
from hric_core.meshes.files import read_coloured
from hric_core.parameters import Settings, number, numbers, text, whole
from hric_core.urdf import Shape, read
from hric_human.participant.settings import HUMAN, HumanSettings
from mujoco_ros_control.person import add_skin, person_model
from mujoco_ros_control.scene_spec import Building, SceneFrame, quaternion

WORLD = "world"
R_CAMERA_OPTICAL: FloatArray = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_R_CAMERA_MUJOCO: FloatArray = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation from MuJoCo's camera frame (looks along -z, y up) to the camera frame (looks along x, z up)."""
_GREY = (0.7, 0.7, 0.7, 1.0)
NEAR, FAR = 0.02, 20.0
"""Nearest and farthest visible distance [m] (project default, unconfirmed)."""
BACKGROUND = (224, 230, 236)
"""Colour of the background, beyond the farthest visible distance: red, green, blue, 0 to 255."""
Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class CameraSettings(Settings):
    """Settings of a simulated camera: size of the image, field of view, and pose."""

    width: int = whole(160, minimum=16, maximum=1280, unit="pixels", text="of a picture")
    height: int = whole(120, minimum=16, maximum=1024, unit="pixels", text="of a picture")
    field_of_view: float = number(0.8, above=0.0, maximum=3.0, unit="rad", text="from the upper to the lower edge")
    parent: str = text(WORLD, empty=False, text="parent of the camera: `world`, a link, or `model::link`")
    xyz: tuple[float, ...] = numbers(3, (1.8, 0.0, 0.9), unit="m", text="position in the parent")
    rpy: tuple[float, ...] = numbers(
        3, (0.0, 0.3, math.pi), unit="rad", text="orientation in the parent; the camera looks along its x"
    )

    @property
    def T_parent_camera(self) -> FloatArray:
        """Pose of the camera in its parent, shape (4, 4)."""
        return transform_from_rpy(self.xyz, self.rpy)

    @property
    def focal_length(self) -> float:
        """Focal length [pixels]."""
        return 0.5 * self.height / math.tan(0.5 * self.field_of_view)


class _Drawing(Building):
    """Builder of a MuJoCo scene for rendering: bodies with the visual shapes of their descriptions.

    The person has a skin instead.
    """

    def __init__(self) -> None:
        super().__init__({}, {})

    def fill(
        self, body: mujoco.MjsBody, model: Model, top: str, cluster: Mapping[str, FloatArray], *, moving: bool
    ) -> None:
        body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0, 1.0, 1.0]  # any value: there is no physics
        for link, T_body_link in cluster.items():
            for k, shape in enumerate(model.tree.links[link].visuals if model.name != HUMAN else ()):
                self._draw(body, f"{model.name}::{link}#{k}", shape, T_body_link @ shape.T_link_shape)
            if link in model.planes:
                self.add_shape(body, f"{model.name}::{link}#plane", Shape(link, "plane", (), np.eye(4)), T_body_link)

    def _draw(self, body: mujoco.MjsBody, name: str, shape: Shape, T_body_shape: FloatArray) -> None:
        if shape.kind != "mesh":
            if all(shape.size):  # shapes without extent are invisible
                self.add_shape(body, name, shape, T_body_shape).rgba = shape.colour or _GREY
            return
        path = find(shape.address, shape.size, shape.where)
        try:
            parts = read_coloured(path, path.read_bytes(), (shape.size[0], shape.size[1], shape.size[2]))
        except (OSError, UnreadableMeshError) as error:
            raise DescriptionError(f"{shape.where}: mesh {shape.address}: {error}") from error
        for part, (surface, colour) in enumerate(parts):
            mesh = f"{name}.{part}"
            self.result.spec.add_mesh(
                name=mesh,
                uservert=surface.vertices.ravel(),
                userface=surface.faces.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )
            self.add_shape(body, mesh, shape, T_body_shape, mesh).rgba = shape.colour or colour or _GREY


class Camera:
    """Simulated camera. It can be used only in the thread that created it, which owns the OpenGL context.

    Args:
        urdf_xml: description of the robot.
        world: path or package:// address of the world file; "": no world file.
        settings: settings of the camera.
        person: settings of the person beside the robot; None: there is none.

    Raises:
        HricError: a description cannot be drawn, the parent is unknown, or there is no OpenGL.
    """

    def __init__(
        self, urdf_xml: str, world: str, settings: CameraSettings, person: HumanSettings | None = None
    ) -> None:
        tree = read(urdf_xml)
        models = [Model(tree.name, urdf_xml, tree, np.eye(4), fixed=True)]
        models += [model_of_object(item) for item in load_world(world, 1.0)]
        skin = None
        if person is not None:
            model, skin = person_model(person)
            models.append(model)
        drawing = _Drawing()
        for model in models:
            drawing.add(model)
        self._free = {model.name: model.free_joint for model in models if not model.fixed}
        self._robot = tree.name
        built = drawing.result
        if skin is not None:
            add_skin(built.spec, built.frames, skin)
        self._add_camera(built.spec, built.frames, settings)
        _add_light(built.spec)
        try:
            self._m = built.spec.compile()
            self._d = mujoco.MjData(self._m)
            self._m.vis.map.znear, self._m.vis.map.zfar = NEAR / self._m.stat.extent, FAR / self._m.stat.extent
            self._canvas = _Canvas(self._m, settings.width, settings.height)
        except Exception as error:  # OpenGL's error types depend on the platform
            raise HricError(f"the camera cannot render: {error}") from error

    def _add_camera(self, spec: mujoco.MjSpec, frames: Mapping[str, SceneFrame], settings: CameraSettings) -> None:
        T, body = settings.T_parent_camera, spec.worldbody
        if settings.parent != WORLD:
            link = settings.parent if "::" in settings.parent else f"{self._robot}::{settings.parent}"
            check_known("link", [link], frames, "the scene")
            frame = frames[link]
            body, T = spec.body(frame.body), frame.T_body_link @ T
        body.add_camera(
            name="camera",
            pos=T[:3, 3],
            quat=quaternion(T[:3, :3] @ _R_CAMERA_MUJOCO),
            fovy=math.degrees(settings.field_of_view),
        )

    def take(
        self,
        positions: Mapping[str, float],
        poses: Mapping[str, FloatArray],
        person: Mapping[str, float] | None = None,
        *,
        depth: bool,
    ) -> tuple[Picture, npt.NDArray[np.float32] | None]:
        """Render an image and, if requested, a depth image of the scene in a given state.

        Args:
            positions: positions of the robot's joints by name [rad or m]; joints that are missing stay, or follow the
                joint that they mimic.
            poses: poses of models' root links in the world by model name, shape (4, 4) each.
            person: positions of the person's joints by name [rad]; None: no person, or the joints stay.
            depth: True to return the depth image.

        Returns:
            Image, shape (height, width, 3), and depth along the optical axis, shape (height, width) [m], which is inf
            if nothing is visible (REP 118); None instead of the depth if it is not requested.
        """
        for model, values in ((self._robot, positions), (HUMAN, person or {})):
            for name, value in values.items():
                joint = mujoco.mj_name2id(self._m, mujoco.mjtObj.mjOBJ_JOINT, f"{model}::{name}")
                if joint >= 0:
                    self._d.qpos[self._m.jnt_qposadr[joint]] = value
        laws = zip(self._m.eq_obj1id, self._m.eq_obj2id, self._m.eq_data, strict=True)
        for follower, leader, (offset, multiplier, *_) in laws:
            at, of = self._m.jnt_qposadr[[follower, leader]]
            self._d.qpos[at] = offset + multiplier * self._d.qpos[of]
        for name, joint in self._free.items():
            if name in poses:
                self._d.joint(joint).qpos[:] = [*poses[name][:3, 3], *quaternion(poses[name][:3, :3])]
        mujoco.mj_kinematics(self._m, self._d)
        mujoco.mj_camlight(self._m, self._d)
        return self._canvas.draw(self._d, depth=depth)

    def close(self) -> None:
        """Release the OpenGL context."""
        self._canvas.close()


_processes: set[int] = set()
"""Processes that have drawn; a fork has that of its parent."""


class _Canvas:
    """Off-screen renderer of the scene.

    One rendering gives colours and distances. Edges are not smoothed (no multisampling), which would take three times
    as long without a graphics card.
    """

    def __init__(self, m: mujoco.MjModel, width: int, height: int) -> None:
        m.vis.quality.offsamples = 0
        m.vis.global_.offwidth, m.vis.global_.offheight = width, height
        self._m, self._shape, self._rect = m, (height, width), mujoco.MjrRect(0, 0, width, height)
        self._gl, self._thread = _context_class()(width, height), threading.get_ident()
        self._use()
        self._scene, self._option = mujoco.MjvScene(m, maxgeom=m.ngeom + m.nskin), mujoco.MjvOption()
        self._view, self._idle = mujoco.MjvCamera(), mujoco.MjvPerturb()
        self._view.type, self._view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
        self._context = mujoco.MjrContext(m, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR

    def draw(self, d: mujoco.MjData, *, depth: bool) -> tuple[Picture, npt.NDArray[np.float32] | None]:
        """Render the scene; return the image and, if `depth`, the distances along the optical axis [m], else None."""
        self._use()  # another canvas may have been drawn meanwhile
        bodies = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._m, d, self._option, self._idle, self._view, bodies, self._scene)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        picture, buffer = np.empty((*self._shape, 3), np.uint8), np.empty(self._shape, np.float32)
        mujoco.mjr_readPixels(picture, buffer, self._rect, self._context)
        picture[buffer == 0.0] = BACKGROUND
        # OpenGL's rows start at the bottom.
        return picture[::-1].copy(), _distances(buffer[::-1]) if depth else None

    def close(self) -> None:
        """Release the OpenGL context."""
        self._use()
        self._context.free()
        self._gl.free()

    def _use(self) -> None:
        """Make the OpenGL context the current one. Raises HricError in another thread, or a fork, in which it hangs."""
        _processes.add(os.getpid())
        if len(_processes) > 1 or threading.get_ident() != self._thread:
            raise HricError(
                "a picture is drawn in another thread than the first, or in a process that was forked after a picture; "
                "valid: one thread, and a process started by spawn"
            )
        self._gl.make_current()


def _context_class() -> Any:
    """Return MuJoCo's class of OpenGL contexts by MUJOCO_GL, also if MuJoCo was loaded without it."""
    name = os.environ.get("MUJOCO_GL") or "egl"
    check_known("MUJOCO_GL", [name], ("egl", "glfw", "osmesa"))
    return importlib.import_module(f"mujoco.{name}").GLContext


def _distances(buffer: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return distances along the optical axis [m] from OpenGL's depth values: 1 at NEAR, 0 at FAR."""
    distances = NEAR * FAR / (NEAR + buffer.astype(np.float64) * (FAR - NEAR))
    return np.where(buffer == 0.0, np.inf, distances).astype(np.float32)


def _add_light(spec: mujoco.MjSpec) -> None:
    """Set a bright light at the camera, since MuJoCo's default light is dim."""
    head = spec.visual.headlight
    head.ambient, head.diffuse, head.specular = [0.3] * 3, [0.5] * 3, [0.1] * 3


def optical_frame(T_parent_camera: FloatArray) -> FloatArray:
    """Return the pose of a camera's optical frame in the camera's parent, shape (4, 4)."""
    return T_parent_camera @ homogeneous(R_CAMERA_OPTICAL, np.zeros(3))


def camera_matrix(settings: CameraSettings) -> Sequence[float]:
    """Return the camera matrix K of sensor_msgs/CameraInfo, row-major: focal lengths and image centre [pixels]."""
    f = settings.focal_length
    return [f, 0.0, 0.5 * settings.width - 0.5, 0.0, f, 0.5 * settings.height - 0.5, 0.0, 0.0, 1.0]
