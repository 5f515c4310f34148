"""The robot as an OpenSim model, built anew whenever its payload or what stands beside it changes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import opensim

from hric_control import urdf as xml
from hric_control.errors import DescriptionError, UnknownNameError
from hric_control.plants.spatial import FloatArray, MassProperties
from opensim_ros_control.scene import Model, together
from urdf_to_osim import Conversion, Options, convert
from urdf_to_osim.urdf import ONE_COORDINATE, Joint, read
from urdf_to_osim.urdf import Robot as Description


@dataclass(frozen=True)
class Built:
    """A model ready for its system.

    Attributes:
        model: connections done, system not yet made.
        coordinates: path of each moving joint's coordinate.
        frames: path of each link's frame; of the robot "link", of others "model::link".
        joints: paths of the coordinates of all moving joints, in the joint's order; of the robot "joint", of others "model::joint".
        description: of all that stands in the model.
        conversion: what OpenSim's objects stand on, to live as long as they do.
    """

    model: opensim.Model
    coordinates: dict[str, str]
    frames: dict[str, str]
    joints: dict[str, tuple[str, ...]]
    description: Description
    conversion: Conversion


class RobotModel:
    """Builds the model of one robot with a fixed base, and whatever parts are put beside it.

    Tensors that no real body has are taken as described, as the plant on PyBullet does.

    Args:
        urdf_xml: pure URDF.
        joint_names: the actuated joints.
        gravity: in the world frame, three numbers [m/s^2].

    Attributes:
        robot: the description.
        joints: its moving joints by name.
        velocity_limits: of its joints, infinite where there is none [rad/s or m/s].
        last_link: behind the last actuated joint.
        load: payload from the next build on: link, and its mass in the link's frame.
        beside: models that stand around the robot from the next build on.
    """

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], gravity: Sequence[float]) -> None:
        self._urdf = urdf_xml
        self.robot = read(urdf_xml)
        self.joints: dict[str, Joint] = {name: joint for name, joint in self.robot.joints.items() if joint.type != "fixed"}
        for name, joint in self.joints.items():
            if joint.type not in ONE_COORDINATE:
                raise DescriptionError(
                    f"joint {name}: type {joint.type!r} is not supported in a robot; valid: {', '.join((*ONE_COORDINATE, 'fixed'))}"
                )
        for name in joint_names:
            if name not in self.joints:
                raise UnknownNameError("moving joint", name, self.joints, f"robot {self.robot.name}")
        self.velocity_limits = _velocity_limits(urdf_xml)
        self._options = Options(gravity=tuple(gravity), inertia="keep", names="rename", stops=False, friction="none", meshes=False)
        self.last_link = self.joints[joint_names[-1]].child
        self.load: tuple[str, MassProperties] | None = None
        self.beside: list[Model] = []

    def check_link(self, link: str) -> None:
        """Raises UnknownNameError when the robot has no such link."""
        if link not in self.robot.links:
            raise UnknownNameError("link", link, self.robot.links, self.robot.name)

    def build(self) -> Built:
        """Robot, payload, and what stands beside it."""
        conversion = convert(together(self._urdf, self.beside), self._options)
        frames = {link: frame.path for link, frame in conversion.frames.items()}
        joints = {name: joint.paths for name, joint in conversion.joints.items() if joint.coordinates}
        coordinates = {name: joints[name][0] for name in self.joints}
        built = Built(conversion.model, coordinates, frames, joints, conversion.plan.robot, conversion)
        if self.load is not None:
            self._add_load(built, *self.load)
            built.model.finalizeConnections()
        return built

    def _add_load(self, built: Built, link: str, load: MassProperties) -> None:
        frame = opensim.PhysicalFrame.safeDownCast(built.model.getComponent(built.frames[link]))
        base = frame.findBaseFrame()
        body = opensim.Body.safeDownCast(built.model.getComponent(base.getAbsolutePathString()))
        if body is None:
            return  # what is fixed to the ground does not move
        total = _mass(body) + load.moved(matrix(frame.findTransformInBaseFrame()))
        body.setMass(total.mass)
        body.setMassCenter(opensim.Vec3(*total.com.tolist()))
        xx, yy, zz = np.diag(total.inertia).tolist()
        body.setInertia(opensim.Inertia(xx, yy, zz, *(float(total.inertia[i, j]) for i, j in ((0, 1), (0, 2), (1, 2)))))


def _velocity_limits(urdf_xml: str) -> dict[str, float]:
    limits = {}
    for name, joint in xml.joints(xml.parse(urdf_xml)).items():
        limit = joint.find("limit")
        limits[name] = (0.0 if limit is None else xml.number(limit, "velocity", f"joint {name}", 0.0)) or math.inf
    return limits


def _mass(body: opensim.Body) -> MassProperties:
    inertia, com = body.getInertia(), body.getMassCenter()
    moments, products = inertia.getMoments(), inertia.getProducts()
    xy, xz, yz = (products.get(i) for i in range(3))
    tensor = np.diag([moments.get(i) for i in range(3)]) + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
    return MassProperties(body.getMass(), np.array([com.get(i) for i in range(3)]), tensor)


def matrix(T: opensim.Transform) -> FloatArray:
    """A transform of OpenSim's as a matrix, shape (4, 4)."""
    result = np.eye(4)
    R, p = T.R(), T.p()
    for i in range(3):
        result[i, 3] = p.get(i)
        for j in range(3):
            result[i, j] = R.get(i, j)
    return result
