"""Dynamics and kinematics of any serial arm by KDL, from its URDF.

PyKDL's containers do not convert to numpy arrays: most of the time is spent on reading and writing their elements. So
what control loops need is compiled (`kdl_solvers.cpp`), with the same results bit for bit.
"""

from collections.abc import Callable, Sequence

import numpy as np
import PyKDL

from franka_hw_interface.urdf_chain import ChainSegment, SerialChain, chain_of
from hric_core.errors import CommandError, DescriptionError, HricError
from hric_core.geometry import FloatArray, MassProperties
from hric_core.native import load
from hric_core.urdf import Robot, read

_kdl = load("hric_kdl")
GRAVITY = (0.0, 0.0, -9.81)
"""Standard acceleration of gravity as in ROS, KDL and libfranka, world frame [m/s^2]."""


def to_kdl_frame(T: FloatArray) -> PyKDL.Frame:
    """Return the KDL frame of a pose, shape (4, 4)."""
    return PyKDL.Frame(PyKDL.Rotation(*T[:3, :3].ravel().tolist()), PyKDL.Vector(*T[:3, 3].tolist()))


def tree_gravity(
    count: int, chains: "Sequence[tuple[KdlChain, Sequence[int]]]"
) -> Callable[[Sequence[float]], list[float]]:
    """Return a function from the joint positions of a tree [rad] to its gravity torques [N m], `count` floats each.

    Args:
        count: number of joints of the tree.
        chains: chains of the tree from the same root, with the indices of their joints; each link has mass in one of
            them only.
    """
    parts = [(chain.gravity_list, tuple(indices)) for chain, indices in chains]
    gravity: Callable[[Sequence[float]], list[float]] = _kdl.tree_gravity(count, parts)
    return gravity


def _numbers(segment: ChainSegment) -> list[float]:
    """Return a segment as the 26 numbers that the compiled module `hric_kdl` expects.

    1.0 for a revolute or 0.0 for a prismatic joint, p and R of `T_parent_joint`, the axis in the parent frame, mass,
    centre of mass, and xx, yy, zz, xy, xz, yz of the inertia tensor.
    """
    T, body = segment.T_parent_joint, segment.inertial
    tensor = body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    arrays = T[:3, 3], T[:3, :3].ravel(), T[:3, :3] @ segment.axis, [body.mass], body.com, tensor
    return [float(segment.kind == "revolute"), *np.concatenate(arrays).tolist()]


def _to_kdl_segment(segment: ChainSegment) -> PyKDL.Segment:
    revolute, *n = _numbers(segment)
    p, axis = PyKDL.Vector(*n[:3]), PyKDL.Vector(*n[12:15])
    joint = PyKDL.Joint(segment.joint, p, axis, PyKDL.Joint.RotAxis if revolute else PyKDL.Joint.TransAxis)
    inertia = PyKDL.RigidBodyInertia(n[15], PyKDL.Vector(*n[16:19]), PyKDL.RotationalInertia(*n[19:]))
    return PyKDL.Segment(segment.link, joint, PyKDL.Frame(PyKDL.Rotation(*n[3:12]), p), inertia)


class _Solvers:
    """KDL chain and its solvers, which refer to the chain; a change of the load replaces all of them together."""

    def __init__(self, description: SerialChain, gravity_base: FloatArray) -> None:
        self.chain = PyKDL.Chain()
        for segment in description.segments:
            self.chain.addSegment(_to_kdl_segment(segment))
        self.forward = PyKDL.ChainFkSolverPos_recursive(self.chain)
        self.differential = PyKDL.ChainJntToJacSolver(self.chain)
        self.dynamics = PyKDL.ChainDynParam(self.chain, PyKDL.Vector(*gravity_base.tolist()))
        self._other: tuple[tuple[float, ...], PyKDL.ChainDynParam] | None = None

    def under_gravity(self, gravity_base: Sequence[float]) -> PyKDL.ChainDynParam:
        """Return the dynamics solver for another gravity vector in the root frame [m/s^2]; the last one is cached."""
        key = tuple(float(value) for value in gravity_base)
        if len(key) != 3 or not np.isfinite(key).all():
            raise CommandError(f"gravity must be three finite numbers; got {list(gravity_base)}")
        if self._other is None or self._other[0] != key:
            self._other = key, PyKDL.ChainDynParam(self.chain, PyKDL.Vector(*key))
        return self._other[1]


class KdlChain:
    """Mass matrix, Coriolis and gravity torque, poses and Jacobians of the chain between two links.

    Links and branches fixed to the chain are included (see `urdf_chain.parse_chain`); movable joints of branches are
    fixed at zero. One instance serves one thread, since its containers are reused. `set_load` may be called from
    another thread; calls that run at that time finish with the old load.

    Args:
        robot: robot description, or its text (pure URDF).
        root, tip: link names.
        gravity_world: gravity in the frame of the URDF's first link, 3 floats [m/s^2].

    Raises:
        DescriptionError, UnknownNameError: the URDF has no such chain.
    """

    def __init__(self, robot: str | Robot, root: str, tip: str, gravity_world: Sequence[float] = GRAVITY) -> None:
        self.description = chain_of(read(robot) if isinstance(robot, str) else robot, root, tip)
        T_world_root = self.description.T_world_root
        if T_world_root is None:
            raise DescriptionError(
                f"the robot description: {root} is moved by a joint, so the direction of gravity in it is not known"
            )
        self.joint_names = self.description.joint_names
        self.n = len(self.joint_names)
        self.gravity_base: FloatArray = T_world_root[:3, :3].T @ np.array(gravity_world, dtype=float)
        """Gravity in the root frame, shape (3,) [m/s^2]."""
        self._q, self._tau = PyKDL.JntArray(self.n), PyKDL.JntArray(self.n)
        self.jacobian_indices = [(i, j) for i in range(6) for j in range(self.n)]
        """Indices of a Jacobian's elements, row by row."""
        self._jacobian, self._frame = PyKDL.Jacobian(self.n), PyKDL.Frame()
        self.T_last_tip = to_kdl_frame(self.description.T_last_tip)
        """Pose of the tip in the last moving link, as a KDL frame."""
        self._use(self.description)

    def _use(self, chain: SerialChain) -> None:
        self._solvers = _Solvers(chain, self.gravity_base)
        segments = [_numbers(segment) for segment in chain.segments]
        self.gravity_list: Callable[[Sequence[float]], list[float]]
        self.gravity_list, *self._compiled = _kdl.functions(segments, self.gravity_base.tolist())
        """Function from q (n floats [rad]) to gravity torque g(q), n floats [N m]: fast path for control loops."""

    def set_load(self, load: MassProperties) -> None:
        """Replace the payload at the tip, given in the tip frame; `MassProperties()` removes it."""
        self._use(self.description.with_load(load))

    def _plain(self, values: Sequence[float] | FloatArray, what: str) -> Sequence[float]:
        plain = values.tolist() if isinstance(values, np.ndarray) else values
        if len(plain) != self.n:
            raise CommandError(f"{what} has {len(plain)} values for {self.n} joints ({', '.join(self.joint_names)})")
        return plain

    def _position(self, q: Sequence[float] | FloatArray) -> PyKDL.JntArray:
        for i, value in enumerate(self._plain(q, "joint position")):
            self._q[i] = value
        return self._q

    def mass(self, q: Sequence[float] | FloatArray) -> FloatArray:
        """Return the joint-space mass matrix M(q), shape (n, n) [kg m^2]; q: shape (n,) [rad]."""
        out = np.empty((self.n, self.n))
        self._compiled[0](self._plain(q, "joint position"), out)
        return out

    def coriolis(self, q: Sequence[float] | FloatArray, dq: Sequence[float] | FloatArray) -> FloatArray:
        """Return the vector C(q, dq) dq as in libfranka, shape (n,) [N m]; dq: shape (n,) [rad/s]."""
        out = np.empty(self.n)
        self._compiled[1](self._plain(q, "joint position"), self._plain(dq, "joint velocity"), out)
        return out

    def point_jacobian(
        self, q: Sequence[float] | FloatArray, segments: int, point: Sequence[float] | None = None
    ) -> FloatArray:
        """Return the Jacobian of a point of the link after the first `segments` joints, in the root frame, (6, n).

        point: in the frame of that link, 3 floats [m]; None: its origin. Linear rows are above angular ones.
        """
        out = np.empty((6, self.n))
        self._compiled[2](self._plain(q, "joint position"), segments, point, out)
        return out

    def gravity(self, q: Sequence[float] | FloatArray, gravity_base: Sequence[float] | None = None) -> FloatArray:
        """Return the torque against gravity, shape (n,) [N m]; gravity_base: in the root frame, 3 floats [m/s^2]."""
        solvers = self._solvers
        dynamics = solvers.dynamics if gravity_base is None else solvers.under_gravity(gravity_base)
        _done(dynamics.JntToGravity(self._position(q), self._tau), "gravity torque")
        return np.array([self._tau[i] for i in range(self.n)])

    def pose(self, q: Sequence[float] | FloatArray) -> FloatArray:
        """Return the pose of the tip in the root frame, shape (4, 4)."""
        return from_kdl_frame(self.kdl_pose(q, self.n) * self.T_last_tip)

    def kdl_pose(self, q: Sequence[float] | FloatArray, segments: int) -> PyKDL.Frame:
        """Return the pose of the link after the first `segments` joints (KDL frame, overwritten by the next call)."""
        _done(self._solvers.forward.JntToCart(self._position(q), self._frame, segments), "pose")
        return self._frame

    def kdl_jacobian(self, q: Sequence[float] | FloatArray, segments: int) -> PyKDL.Jacobian:
        """Return the Jacobian of the origin of the link after the first `segments` joints, in the root frame.

        A KDL container, which the next call overwrites.
        """
        PyKDL.SetToZero(self._jacobian)
        _done(self._solvers.differential.JntToJac(self._position(q), self._jacobian, segments), "Jacobian")
        return self._jacobian

    def jacobian(self, q: Sequence[float] | FloatArray) -> FloatArray:
        """Return the Jacobian of the tip, linear above angular velocity in the root frame, shape (6, n)."""
        return self.point_jacobian(q, self.n, list(self.T_last_tip.p))


_FRAME_INDICES = tuple((i, j) for i in range(3) for j in range(4))
_LAST_ROW = [0.0, 0.0, 0.0, 1.0]


def from_kdl_frame(frame: PyKDL.Frame) -> FloatArray:
    """Return the pose of a KDL frame, shape (4, 4)."""
    return np.array([frame[index] for index in _FRAME_INDICES] + _LAST_ROW).reshape(4, 4)


def from_kdl_jacobian(jacobian: PyKDL.Jacobian, indices: Sequence[tuple[int, int]]) -> FloatArray:
    """Return a KDL Jacobian as an array, linear above angular, shape (6, n).

    Args:
        jacobian: KDL container.
        indices: (row, column) of all its elements, row by row.
    """
    return np.array([jacobian[index] for index in indices]).reshape(6, -1)


def _done(code: int, what: str) -> None:
    if code != 0:
        raise HricError(f"KDL could not compute the {what}: error {code}")
