"""Reference values for the proof: the robot description in an independent rigid-body library (pinocchio).

Values are in OpenSim's coordinates. Pinocchio reads the description itself; only elements that it would misread are
changed in the XML before: the axis of a planar joint, which it ignores, becomes part of the joint's origin; mimic
joints become free joints; repaired inertias replace the described ones.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, MassProperties, homogeneous
from hric_core.geometry.transforms import inverse
from hric_core.urdf import Joint, Limit, write_inertial, write_origin
from hric_core.urdf.elements import parse
from urdf_to_osim import transforms
from urdf_to_osim.joints import joint_rotation
from urdf_to_osim.prepare import ConversionPlan

# In pinocchio links and joints share one namespace.
LINK, JOINT = "link:", "joint:"
NOT_DYNAMICS = (
    "visual",
    "collision",
    "transmission",
    "gazebo",
    "material",
    "mimic",
    "safety_controller",
    "calibration",
)


Motion = tuple[FloatArray, FloatArray, FloatArray]
"""Motion (q, J, Jd xd) of a joint or the robot in pinocchio's coordinates: position q, velocity v, acceleration a.

v = J xd and a = J xdd + Jd xd, where x, xd and xdd are coordinates, speeds and accelerations in OpenSim.
"""


class Oracle:
    """Robot description in pinocchio, as reference for the OpenSim model.

    Args:
        plan: decisions of the conversion, with the inertias to use.
        urdf_xml: robot description.
        gravity: gravity in axes of the root link, three numbers [m/s^2].
        up: axis of OpenSim's ground, "y" or "z", that points along z of the root link.

    Attributes:
        joints: joints with coordinates; all arrays have the coordinates of these joints in order, shape (n,).

    Raises:
        DescriptionError: pinocchio cannot read the description.
    """

    def __init__(self, plan: ConversionPlan, urdf_xml: str, gravity: Sequence[float], up: str) -> None:
        try:
            self._model = pin.buildModelFromXML(rewritten(plan, urdf_xml))
        except (ValueError, RuntimeError) as error:
            raise DescriptionError(
                f"robot {plan.robot.name}: the model cannot be verified, since pinocchio cannot read the description: "
                f"{error}"
            ) from error
        self._model.gravity.linear = np.asarray(gravity, dtype=float)
        self._data = self._model.createData()
        self._T_ground_base = transforms.base_pose(up)
        self._frames = {name: self._model.getFrameId(LINK + name) for name in plan.robot.links}
        self.joints = [joint for joint in plan.robot.joints.values() if joint.type != "fixed"]
        self._pin_joints = [self._model.joints[self._model.getJointId(JOINT + joint.name)] for joint in self.joints]
        sizes = np.cumsum([0, *(joint.nv for joint in self._pin_joints)])
        self._slices = [slice(int(a), int(b)) for a, b in pairwise(sizes)]
        self.size = int(sizes[-1])
        self._known: tuple[bytes, Motion] | None = None

    def frames(self, x: FloatArray) -> dict[str, FloatArray]:
        """Return the pose of each link in OpenSim's ground, shape (4, 4) [m], at coordinates x."""
        q, _, _ = self._motion(x, np.zeros(self.size))
        pin.framesForwardKinematics(self._model, self._data, q)
        return {name: self._T_ground_base @ self._data.oMf[index].homogeneous for name, index in self._frames.items()}

    def mass(self, x: FloatArray) -> FloatArray:
        """Return the mass matrix at coordinates x, shape (n, n) [kg m^2, kg m, kg]."""
        q, J, _ = self._motion(x, np.zeros(self.size))
        M = np.triu(pin.crba(self._model, self._data, q))
        M = M + np.triu(M, 1).T
        return np.asarray(J.T @ M @ J)

    def gravity(self, x: FloatArray) -> FloatArray:
        """Return the efforts that hold the robot still at coordinates x, shape (n,) [N m or N]."""
        q, J, _ = self._motion(x, np.zeros(self.size))
        return np.asarray(J.T @ pin.computeGeneralizedGravity(self._model, self._data, q))

    def inverse_dynamics(self, x: FloatArray, xd: FloatArray, xdd: FloatArray) -> FloatArray:
        """Return the efforts for a motion (x, xd, xdd), without damping and friction, shape (n,) [N m or N]."""
        q, J, Jd_xd = self._motion(x, xd)
        return np.asarray(J.T @ pin.rnea(self._model, self._data, q, J @ xd, J @ xdd + Jd_xd))

    def described(self, joint: Joint) -> Joint:
        """Return a copy of a one-coordinate joint with limits, damping and friction as pinocchio reads them."""
        pin_joint = self._pin_joints[self.joints.index(joint)]
        v, model = pin_joint.idx_v, self._model
        lower, upper = (
            (0.0, 0.0)
            if joint.type == "continuous"
            else (model.lowerPositionLimit[pin_joint.idx_q], model.upperPositionLimit[pin_joint.idx_q])
        )
        limit = Limit(float(lower), float(upper), float(model.upperEffortLimit[v]), None)
        return replace(
            joint, limit=limit, damping=float(model.damping[v]), friction=float(model.upperDryFrictionLimit[v])
        )

    def _motion(self, x: FloatArray, xd: FloatArray) -> Motion:
        """Return the motion in pinocchio's coordinates for x and xd; the last result is cached.

        J has pinocchio's velocities as rows and OpenSim's coordinates as columns.
        """
        key = x.tobytes() + xd.tobytes()
        if self._known is None or self._known[0] != key:
            self._known = key, self._find_motion(x, xd)
        return self._known[1]

    def _find_motion(self, x: FloatArray, xd: FloatArray) -> Motion:
        q, J, Jd_xd = pin.neutral(self._model), np.zeros((self.size, self.size)), np.zeros(self.size)
        for joint, pin_joint, part in zip(self.joints, self._pin_joints, self._slices, strict=True):
            rows = slice(pin_joint.idx_v, pin_joint.idx_v + pin_joint.nv)
            position = slice(pin_joint.idx_q, pin_joint.idx_q + pin_joint.nq)
            q[position], J[rows, part], Jd_xd[rows] = MOTIONS[joint.type](x[part], xd[part])
        return q, J, Jd_xd


ONE, NONE = np.eye(1), np.zeros(1)


def _single(x: FloatArray, xd: FloatArray) -> Motion:
    return x, ONE, NONE


def _continuous(x: FloatArray, xd: FloatArray) -> Motion:
    return np.array([math.cos(x[0]), math.sin(x[0])]), ONE, NONE


def _planar(x: FloatArray, xd: FloatArray) -> Motion:
    """Return the motion of a planar joint with OpenSim's coordinates (theta, x, y).

    Pinocchio has the position (x, y, cos, sin) and the velocity in axes of the child link.
    """
    c, s = math.cos(x[0]), math.sin(x[0])
    J = np.array([[0.0, c, s], [0.0, -s, c], [1.0, 0.0, 0.0]])
    Jd = xd[0] * np.array([[0.0, -s, c], [0.0, -c, -s], [0.0, 0.0, 0.0]])
    return np.array([x[1], x[2], c, s]), J, Jd @ xd


def _floating(x: FloatArray, xd: FloatArray) -> Motion:
    """Return the motion of a floating joint with OpenSim's coordinates (a, b, c, p), R = Rx(a) Ry(b) Rz(c).

    OpenSim's speeds are (omega, pd) in axes of the joint frame, not the derivatives of the angles. Pinocchio has the
    position (p, quaternion) and the twist (R' pd, R' omega) in axes of the child link.
    """
    R = pin.utils.rotate("x", x[0]) @ pin.utils.rotate("y", x[1]) @ pin.utils.rotate("z", x[2])
    J = np.zeros((6, 6))
    J[:3, 3:] = J[3:, :3] = R.T
    omega, velocity = R.T @ xd[:3], R.T @ xd[3:]
    bias = np.concatenate([-np.cross(omega, velocity), np.zeros(3)])
    return np.concatenate([x[3:], pin.Quaternion(R).coeffs()]), J, bias


MOTIONS: dict[str, Callable[[FloatArray, FloatArray], Motion]] = {
    "revolute": _single,
    "prismatic": _single,
    "continuous": _continuous,
    "planar": _planar,
    "floating": _floating,
}


def rewritten(plan: ConversionPlan, urdf_xml: str) -> str:
    """Return the robot description, changed so that pinocchio reads it correctly and with the inertias of the plan."""
    root = parse(urdf_xml)
    for element in root.iter():
        for name in {"xyz", "rpy", "quat_xyzw"}.intersection(element.keys()):
            element.set(name, " ".join(element.get(name, "").split()))  # urdfdom accepts only spaces
    root.set("name", plan.robot.name)
    for parent in list(root.iter()):
        for child in [child for child in parent if child.tag in NOT_DYNAMICS]:
            parent.remove(child)
    for link in root.findall("link"):
        name = link.get("name", "")
        mass = plan.robot.links[name].mass
        if mass is not None and mass is not plan.described.links[name].mass:
            _replace_inertial(link, mass)
        link.set("name", LINK + name)
    for joint in root.findall("joint"):
        _rewrite_joint(root, joint, plan.robot.joints[joint.get("name", "")])
    return ElementTree.tostring(root, encoding="unicode")


def _replace_inertial(link: Element, mass: MassProperties) -> None:
    for old in link.findall("inertial"):
        link.remove(old)
    write_inertial(link, mass.mass, homogeneous(np.eye(3), mass.com), mass.inertia)


def _rewrite_joint(root: Element, element: Element, joint: Joint) -> None:
    element.set("name", JOINT + joint.name)
    for side, link in (("parent", joint.parent), ("child", joint.child)):
        tag = element.find(side)
        assert tag is not None
        tag.set("link", LINK + link)
    limit = element.find("limit")
    for name in ("effort", "velocity") if limit is not None else ():
        limit.attrib.setdefault(name, "0")  # type: ignore[union-attr]
    if joint.type == "planar":
        _rewrite_planar(root, element, joint)


def _rewrite_planar(root: Element, element: Element, joint: Joint) -> None:
    """Rewrite a planar joint so that its normal is z: rotate its origin, and rotate back by a fixed joint behind it."""
    A = homogeneous(joint_rotation(joint))
    for old in element.findall("origin"):
        element.remove(old)
    write_origin(element, joint.T_parent_joint @ A)
    turned = f"{LINK}turned:{joint.child}"
    child = element.find("child")
    assert child is not None
    child.set("link", turned)
    SubElement(root, "link", name=turned)
    back = SubElement(root, "joint", name=f"{JOINT}back:{joint.name}", type="fixed")
    SubElement(back, "parent", link=turned)
    SubElement(back, "child", link=LINK + joint.child)
    write_origin(back, inverse(A))
