"""Conversion of a robot description to an OpenSim model in memory."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import opensim

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.urdf import Joint, read
from urdf_to_osim import forces, joints, shapes, transforms
from urdf_to_osim.options import Options
from urdf_to_osim.prepare import ILLEGAL, ConversionPlan, prepare


@dataclass(frozen=True)
class JointMap:
    """Counterpart of a joint of the description in the OpenSim model.

    Attributes:
        kind: URDF type of the joint.
        path: path of the OpenSim joint, e.g. "/jointset/panda_joint1"; empty if a fixed joint became an offset frame.
        coordinates: names of the joint's coordinates, in the order of `joints.coordinate_names`.
    """

    kind: str
    path: str
    coordinates: tuple[str, ...]

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of the coordinates in the model; unlike names they are always unique."""
        return tuple(f"{self.path}/{name}" for name in self.coordinates)


@dataclass(frozen=True)
class FrameMap:
    """Counterpart of a link of the description in the OpenSim model: `path` of a frame with its origin and axes."""

    path: str


@dataclass
class Conversion:
    """Result of a conversion: the OpenSim model in memory.

    Attributes:
        model: OpenSim model with finalised connections; the caller must call `initSystem`.
        joints, frames: place in the model of each joint and link of the description, by name.
        notes: texts about repairs, renamings and omissions.
        plan, options: decisions and options of the conversion.
        meshes: visual and contact shapes that need a mesh file.
        geometry: bare name of the mesh file of each of these shapes, by the shape's name; filled by `geometry.lay`.
        attached: (function that sets the mesh file, OpenSim component) of each of these shapes, by the shape's name.
    """

    model: opensim.Model
    joints: dict[str, JointMap]
    frames: dict[str, FrameMap]
    notes: list[str]
    plan: ConversionPlan
    options: Options
    meshes: list[shapes.OsimShape] = field(default_factory=list)
    geometry: dict[str, str] = field(default_factory=dict)
    attached: dict[str, tuple[Callable[[str], None], opensim.Component]] = field(default_factory=dict, repr=False)


def convert(urdf_xml: str, options: Options | None = None) -> Conversion:
    """Convert a URDF text to an OpenSim model.

    Raises:
        DescriptionError: the description is unusable, or OpenSim cannot represent it; the text says what to change.
        UnknownNameError: the options name a joint that does not exist.
    """
    options = options or Options()
    plan = prepare(read(urdf_xml), options)
    builder = _Builder(plan, options)
    try:
        builder.bodies()
        forces.add(builder.model, plan, options)
        waiting = shapes.add(builder.model, plan, options, builder.carriers, builder.notes)
        builder.model.finalizeConnections()
    except RuntimeError as error:
        raise DescriptionError(
            f"OpenSim cannot build a model of robot {plan.robot.name}: {transforms.message_of(error)}"
        ) from error
    return Conversion(builder.model, builder.joints, builder.frames, builder.notes, plan, options, waiting)


class _Builder:
    """Builder of the OpenSim model's bodies and joints, from the root link outwards."""

    def __init__(self, plan: ConversionPlan, options: Options) -> None:
        self.plan = plan
        self.notes = list(plan.notes)
        self.joints: dict[str, JointMap] = {}
        self.frames: dict[str, FrameMap] = {}
        # For each link: the body (or ground) to which it belongs, and the link's pose in it.
        self.carriers: dict[str, tuple[opensim.PhysicalFrame, FloatArray]] = {}
        self._pose = transforms.base_pose(options.up)
        self.model = opensim.Model()
        # Forbidden characters always become underscores, since nothing refers to this name.
        self.model.setName(ILLEGAL.sub("_", options.name or plan.robot.name))
        self.model.setGravity(transforms.vec3(self._pose[:3, :3] @ np.asarray(options.gravity, dtype=float)))

    def bodies(self) -> None:
        """Add all links and joints to the model."""
        self._root()
        for joint in self.plan.robot.joints.values():
            if joint.child in self.plan.bodies:
                self._jointed(joint)
            else:
                carrier, T_carrier_parent = self.carriers[joint.parent]
                self._frame(joint.child, carrier, T_carrier_parent @ joint.T_parent_joint)
                self.joints[joint.name] = JointMap(joint.type, "", ())

    def _root(self) -> None:
        """Fix the root link in ground, with a weld joint if it has mass."""
        root = self.plan.robot.root
        ground = self.model.updGround()
        if root not in self.plan.bodies:
            self._frame(root, ground, self._pose)
            return
        body = self._body(root)
        self.model.addJoint(
            opensim.WeldJoint(
                f"{body.getName()}_to_ground",
                ground,
                *transforms.offset(self._pose),
                body,
                *transforms.offset(np.eye(4)),
            )
        )

    def _jointed(self, joint: Joint) -> None:
        name = self.plan.joints[joint.name]
        carrier, T_carrier_parent = self.carriers[joint.parent]
        self.model.addJoint(joints.build(joint, name, carrier, T_carrier_parent, self._body(joint.child)))
        self.joints[joint.name] = JointMap(joint.type, f"/jointset/{name}", joints.coordinate_names(joint, name))

    def _body(self, link: str) -> opensim.Body:
        name, mass = self.plan.links[link], self.plan.masses.get(link)
        body = opensim.Body(name, 0.0, opensim.Vec3(0.0), opensim.Inertia(0.0))
        if mass is not None:
            J = mass.inertia
            tensor = opensim.Inertia(*(float(J[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))))
            body = opensim.Body(name, mass.mass, transforms.vec3(mass.com), tensor)
        self.model.addBody(body)
        self.carriers[link] = (body, np.eye(4))
        self.frames[link] = FrameMap(f"/bodyset/{name}")
        return body

    def _frame(self, link: str, carrier: opensim.PhysicalFrame, T_carrier_link: FloatArray) -> None:
        frame = opensim.PhysicalOffsetFrame()
        frame.setName(self.plan.links[link])
        frame.setParentFrame(carrier)
        transforms.set_offset(frame, T_carrier_link)
        carrier.addComponent(frame)
        self.carriers[link] = (carrier, T_carrier_link)
        self.frames[link] = FrameMap(f"{carrier.getAbsolutePathString()}/{frame.getName()}")
