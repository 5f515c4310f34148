"""Contact forces in the joints of an arm: the net joint force of inverse dynamics minus the muscle forces.

    contact = JointContact(whole, anatomy, muscles.names)
    contact.over(q, whole.inverse_dynamics(q, dq, ddq, T_world_root, loads), forces)["right_shoulder"]   # (n, 3) [N]

A muscle presses the bones that it spans together, so in a loaded arm a contact force is several times the net force.
The net force on the distal part follows from gravity, inertia and loads. Muscles that cross the joint provide a part of
it; the proximal bone provides the rest, which includes ligaments and labrum. Muscles of the wrist and of the fingers
are not modelled, so the elbow force of a gripping hand is underestimated.
"""

from collections.abc import Sequence

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose, Vector
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_human.body.segments import ROOT
from hric_human.control.kinematics import GRAVITY
from hric_human.control.whole_body import ExternalLoad, Needed, RootMotion, WholeBody
from hric_human.muscles.anatomy import CENTRES, Anatomy

DISTAL = {"shoulder": "upper_arm", "elbow": "forearm"}
"""Segment on the distal side of each joint centre."""
_MIRROR = np.array([1.0, -1.0, 1.0])


class Pulls:
    """Direction of the force of a right arm's muscles on the bone distal to each joint centre, at many poses at once.

    Args:
        anatomy: fitted muscles of the arm.

    Attributes:
        names: names of the muscles that cross a joint centre, by centre.
    """

    def __init__(self, anatomy: Anatomy) -> None:
        self._anatomy = anatomy
        self.names = {
            centre: tuple(name for name, muscle in anatomy.muscles.items() if centre in muscle.pulls)
            for centre in CENTRES
        }
        rows = [
            part for centre in CENTRES for name in self.names[centre] for part in anatomy.muscles[name].pulls[centre]
        ]
        joints, powers = len(anatomy.joints), [part.powers(anatomy.joints) for part in rows]
        self._power, term = np.unique(
            np.concatenate([np.zeros((1, joints), int), *powers]), axis=0, return_inverse=True
        )
        self._orders, self._columns = np.arange(self._power.max(initial=0) + 1), np.arange(joints)
        crossed = len(self.names[CENTRES[0]])
        self._rows = {CENTRES[0]: slice(0, crossed), CENTRES[1]: slice(crossed, None)}
        self._coefficients = np.zeros((len(self._power), len(rows)))
        start = 1
        for column, part in enumerate(rows):
            end = start + len(part.coefficients)
            self._coefficients[term.ravel()[start:end], column] = part.coefficients
            start = end

    def at(self, q: FloatArray) -> dict[str, FloatArray]:
        """Return the force on the distal bone per muscle force, in axes of the proximal link, for the muscles `names`.

        Args:
            q: angles of the anatomy's joints, shape (n, joints) [rad]; clipped to the range of the fit.

        Returns:
            by centre, shape (n, muscles, 3) [1].
        """
        powers = np.clip(q, self._anatomy.lower, self._anatomy.upper)[:, :, None] ** self._orders
        terms = np.prod(powers[:, self._columns, self._power], axis=2)
        values = (terms @ self._coefficients).reshape(len(q), -1, 3)
        return {centre: values[:, rows] for centre, rows in self._rows.items()}


class _Joint:
    """Joint centre on one side of a body.

    Attributes:
        side, centre: side and name of the centre.
        link: index of the distal link.
        proximal: index of the proximal link, in whose axes muscle forces are given; None: the root.
        rows: indices of the muscles that cross the joint, in the array of forces.
    """

    def __init__(self, dynamics: WholeBody, side: str, centre: str, rows: list[int]) -> None:
        distal = dynamics.body.segments[f"{side}_{DISTAL[centre]}"]
        self.side, self.centre, self.rows = side, centre, rows
        first = next(joint.child for joint in dynamics.body.joints.values() if joint.link == distal.link)
        self.link = dynamics.index[first]
        self.proximal = None if distal.parent == ROOT else dynamics.index[distal.parent]


class JointContact:
    """Contact forces at the shoulders (glenohumeral) and elbows of a body.

    Args:
        dynamics: dynamics of the body.
        anatomy: fitted muscles of an arm.
        names: names of the muscles and actuators, in the order of the forces.

    Attributes:
        links: links on which the joint forces act, by joint: "right_shoulder", "right_elbow".

    Raises:
        HricError: a muscle of the anatomy is not among the names.
    """

    def __init__(self, dynamics: WholeBody, anatomy: Anatomy, names: Sequence[str]) -> None:
        self._dynamics, self._pulls = dynamics, Pulls(anatomy)
        order = list(dynamics.body.joints)
        sides = [side for side in ("right", "left") if f"{side}_upper_arm" in dynamics.body.segments]
        self._angles = {side: [order.index(f"{side}_{joint}") for joint in anatomy.joints] for side in sides}
        self._joints = dict[str, _Joint]()
        for side in sides:
            for centre, muscles in self._pulls.names.items():
                missing = [f"{side}_{name}" for name in muscles if f"{side}_{name}" not in names]
                if missing:
                    raise HricError(
                        f"joint contact forces need the force of muscle {missing[0]}; available: {', '.join(names)}"
                    )
                rows = [list(names).index(f"{side}_{name}") for name in muscles]
                self._joints[f"{side}_{centre}"] = _Joint(dynamics, side, centre, rows)
        self.links = {name: dynamics.links[joint.link].name for name, joint in self._joints.items()}

    def over(self, q: FloatArray, root: Pose | RootMotion, needed: Needed, forces: FloatArray) -> dict[str, FloatArray]:
        """Return the joint contact forces at n instants.

        Args:
            q: joint positions, shape (n, j) [rad].
            root: pose or motion of the root link in the world, see `WholeBody.inverse_dynamics`.
            needed: inverse dynamics of the motion, see `WholeBody.inverse_dynamics`.
            forces: forces of muscles along their lines of action, shape (n, k) [N]; those of actuators have no effect.

        Returns:
            force of the proximal on the distal bone, in axes of the world, by joint, shape (n, 3) each [N].
        """
        pulls = {side: self._pulls.at(q[:, columns]) for side, columns in self._angles.items()}
        R_world_root = _rotation(root)
        contact_forces = {}
        for name, joint in self._joints.items():
            pull = (forces[:, None, joint.rows] @ pulls[joint.side][joint.centre])[:, 0]
            if joint.side == "left":
                pull = pull * _MIRROR
            R = R_world_root if joint.proximal is None else needed.rotation[:, joint.proximal]
            contact_forces[name] = needed.force[:, joint.link] - (R @ pull[:, :, None])[:, :, 0]
        return contact_forces

    def at(
        self,
        q: Sequence[float],
        dq: Sequence[float],
        ddq: Sequence[float],
        forces: FloatArray,
        T_world_root: Pose,
        loads: Sequence[ExternalLoad] = (),
        gravity: Vector = GRAVITY,
    ) -> dict[str, Vector]:
        """Return the joint contact forces at one instant, in axes of the world, by joint [N].

        Args:
            q: joint positions, n floats [rad].
            dq: joint velocities, n floats [rad/s].
            ddq: joint accelerations, n floats [rad/s^2].
            forces: forces of muscles along their lines of action, shape (k,) [N].
            T_world_root: pose of the root link, which is at rest.
            loads: external loads on links, with one instant each.
            gravity: gravity vector in axes of the world [m/s^2].
        """
        angles, speeds, rates = (np.array([values], np.float64) for values in (q, dq, ddq))
        needed = self._dynamics.inverse_dynamics(angles, speeds, rates, T_world_root, loads, gravity)
        contact_forces = self.over(angles, T_world_root, needed, np.asarray(forces)[None])
        return {name: (float(x), float(y), float(z)) for name, ((x, y, z),) in contact_forces.items()}


def _rotation(root: Pose | RootMotion) -> FloatArray:
    """Return the rotation of the root link, shape (3, 3), or (n, 3, 3) if it moves."""
    if isinstance(root, Pose):
        return rotation_from_quaternion(root.orientation)
    return np.array([rotation_from_quaternion(quaternion) for quaternion in root.orientation.tolist()])
