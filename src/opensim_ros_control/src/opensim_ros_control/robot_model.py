"""OpenSim model of the robot and the models around it, built again whenever these or the payload change."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import opensim

from hric_control.plants import Model
from hric_core import urdf
from hric_core.errors import DescriptionError
from hric_core.geometry import MassProperties
from opensim_ros_control.scene import together
from urdf_to_osim import Conversion, Options, convert
from urdf_to_osim.transforms import matrix


@dataclass(frozen=True)
class Built:
    """OpenSim model that was built, before `initSystem`.

    Attributes:
        model: OpenSim model with finalised connections.
        frames: OpenSim path of each link's frame, by "link" (robot) or "model::link".
        joints: OpenSim paths of the coordinates of each moving joint, by "joint" (robot) or "model::joint".
        description: description of the complete model.
        conversion: result of the conversion; it owns OpenSim's objects, so it must live as long as they are used.
    """

    model: opensim.Model
    frames: dict[str, str]
    joints: dict[str, tuple[str, ...]]
    description: urdf.Robot
    conversion: Conversion


class RobotModel:
    """Builder of the OpenSim model of one robot with a fixed base and of the models around it.

    Physically impossible inertia tensors are used as they are described, as in the plant on PyBullet.

    Args:
        urdf_xml: robot description (pure URDF).
        gravity: gravity in the world frame, three numbers [m/s^2].

    Attributes:
        robot: robot description.
        loads: payloads by link, in the link's frame, from the next build on.
        neighbours: models around the robot from the next build on.
    """

    def __init__(self, urdf_xml: str, gravity: Sequence[float]) -> None:
        self._urdf = urdf_xml
        self.robot = urdf.read(urdf_xml)
        valid = (*urdf.ONE_COORDINATE, "fixed")
        for name, joint in self.robot.joints.items():
            if joint.type not in valid:
                raise DescriptionError(
                    f"joint {name}: type {joint.type!r} is not supported in a robot; valid: {', '.join(valid)}"
                )
        self._options = Options(
            gravity=tuple(gravity), inertia="keep", names="rename", stops=False, friction="none", meshes=False
        )
        self.loads: Mapping[str, MassProperties] = {}
        self.neighbours: list[Model] = []

    def build(self) -> Built:
        """Build an OpenSim model of the robot with its payloads and the models around it."""
        conversion = convert(together(self._urdf, self.neighbours), self._options)
        frames = {link: frame.path for link, frame in conversion.frames.items()}
        joints = {name: joint.paths for name, joint in conversion.joints.items() if joint.coordinates}
        built = Built(conversion.model, frames, joints, conversion.plan.robot, conversion)
        for link, load in self.loads.items():
            self._add_load(built, link, load)
        if self.loads:
            built.model.finalizeConnections()
        return built

    def _add_load(self, built: Built, link: str, load: MassProperties) -> None:
        frame = opensim.PhysicalFrame.safeDownCast(built.model.getComponent(built.frames[link]))
        base = frame.findBaseFrame()
        body = opensim.Body.safeDownCast(built.model.getComponent(base.getAbsolutePathString()))
        if body is None:
            return  # a link fixed to ground does not move
        total = mass_properties(body) + load.moved(matrix(frame.findTransformInBaseFrame()))
        body.setMass(total.mass)
        body.setMassCenter(opensim.Vec3(*total.com.tolist()))
        xx, yy, zz = np.diag(total.inertia).tolist()
        body.setInertia(opensim.Inertia(xx, yy, zz, *(float(total.inertia[i, j]) for i, j in ((0, 1), (0, 2), (1, 2)))))


def mass_properties(body: opensim.Body) -> MassProperties:
    """Return mass, centre of mass and inertia of an OpenSim body, in the body's axes."""
    inertia, com = body.getInertia(), body.getMassCenter()
    moments, products = inertia.getMoments(), inertia.getProducts()
    xy, xz, yz = (products.get(i) for i in range(3))
    tensor = np.diag([moments.get(i) for i in range(3)]) + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
    return MassProperties(body.getMass(), np.array([com.get(i) for i in range(3)]), tensor)
