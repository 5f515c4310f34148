"""Mass matrix and point Jacobians of any robot description, without an engine."""

from collections.abc import Mapping

import numpy as np

from hric_core.geometry import FloatArray, MassProperties, homogeneous
from hric_core.geometry.transforms import rotation_about, rotation_onto, skew
from hric_core.urdf.robot import ONE_COORDINATE, Joint, Robot


def mass_matrix(robot: Robot, q: Mapping[str, float]) -> tuple[FloatArray, list[str]]:
    """Return the mass matrix by the composite rigid body algorithm, in axes of the root link; mimic joints move freely.

    Args:
        robot: the description.
        q: coordinates of joints with one coordinate [rad or m]; all others are at zero.

    Returns:
        Matrix, shape (n, n) [kg m^2, kg m, kg], and the joint of each row: joints in order, planar ones with three rows
            (angle, x, y), floating ones with six (rotations, translations).
    """
    T, moving, rows, S = _posed(robot, q)
    M, composite = (
        np.zeros((len(rows), len(rows))),
        {name: _inertia(link.mass, T[name]) for name, link in robot.links.items()},
    )
    for joint in reversed(robot.joints.values()):
        columns = moving[joint.child]
        if own_columns := columns[len(moving[joint.parent]) :]:
            block = S[:, columns].T @ composite[joint.child] @ S[:, own_columns]
            M[np.ix_(columns, own_columns)] = block
            M[np.ix_(own_columns, columns)] = block.T
        composite[joint.parent] = composite[joint.parent] + composite[joint.child]
    return M, rows


def point_jacobian(robot: Robot, q: Mapping[str, float], link: str, point: FloatArray) -> FloatArray:
    """Return the velocity of a point on a link per joint speed, shape (3, n), with the columns of `mass_matrix`.

    Args:
        robot: the description.
        q: coordinates, as in `mass_matrix`.
        link: name of the link.
        point: present position, in axes of the root link, shape (3,) [m].

    Raises:
        UnknownNameError: no such link.
    """
    robot.check_link(link)
    _, moving, rows, S = _posed(robot, q)
    J, columns = np.zeros((3, len(rows))), moving[link]
    J[:, columns] = S[3:, columns] - skew(point) @ S[:3, columns]
    return J


def _posed(
    robot: Robot, q: Mapping[str, float]
) -> tuple[dict[str, FloatArray], dict[str, list[int]], list[str], FloatArray]:
    """Return the links' poses, the rows of the joints that move each, each row's joint, and its twist, shape (6, n)."""
    T = {robot.root: np.eye(4)}
    rows: list[str] = []
    moving: dict[str, list[int]] = {robot.root: []}
    twists: list[FloatArray] = []
    for joint in robot.joints.values():
        T_root_joint = T[joint.parent] @ joint.T_parent_joint
        joint_twists = _twists(joint, T_root_joint)
        moving[joint.child] = moving[joint.parent] + list(range(len(rows), len(rows) + joint_twists.shape[1]))
        rows += [joint.name] * joint_twists.shape[1]
        twists.append(joint_twists)
        T[joint.child] = T_root_joint @ _motion(joint, q.get(joint.name, 0.0))
    return T, moving, rows, np.hstack([np.zeros((6, 0)), *twists])


def _twists(joint: Joint, T_root_joint: FloatArray) -> FloatArray:
    """Return angular velocity and velocity of the root's origin for each speed, shape (6, n)."""
    if joint.type == "fixed":
        return np.zeros((6, 0))
    turning = sliding = np.zeros((3, 0))
    if joint.type in ("revolute", "continuous"):
        turning = joint.axis[:, None]
    elif joint.type == "prismatic":
        sliding = joint.axis[:, None]
    elif joint.type == "planar":
        sliding, turning = np.hsplit(rotation_onto(2, joint.axis), [2])
    elif joint.type == "floating":
        turning = sliding = np.eye(3)
    R, p = T_root_joint[:3, :3], T_root_joint[:3, 3]
    turning, sliding = R @ turning, R @ sliding
    return np.hstack([np.vstack([turning, skew(p) @ turning]), np.vstack([np.zeros_like(sliding), sliding])])


def _motion(joint: Joint, q: float) -> FloatArray:
    """Return the pose of the child in the joint frame, shape (4, 4) [m]."""
    if joint.type == "prismatic":
        return homogeneous(np.eye(3), q * joint.axis)
    return homogeneous(rotation_about(joint.axis, q)) if joint.type in ONE_COORDINATE else np.eye(4)


def _inertia(body: MassProperties | None, T_root_link: FloatArray) -> FloatArray:
    """Return the spatial inertia about the root's origin, shape (6, 6)."""
    if body is None:
        return np.zeros((6, 6))
    moved = body.moved(T_root_link)
    C = skew(moved.com)
    G = np.diag([0.0, 0.0, 0.0, *[body.mass] * 3])
    G[:3, :3] = moved.inertia + body.mass * C @ C.T
    G[:3, 3:], G[3:, :3] = body.mass * C, body.mass * C.T
    return G
