"""A body whose joints swing: as messages of a simulated human, and as reference computed by pinocchio."""

from typing import Any

import numpy as np
import pinocchio
from sensor_msgs.msg import JointState

from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.robot_time import stamps
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

PERSON: dict[str, Any] = {"subject": "P50_male", "parts": "both_arms", "position": [0.9, 0.1], "heading": 2.8}
BODY = describe(HumanSettings.of(PERSON, "human").person)
JOINTS = list(BODY.joints)
RANGES = [joint.range for joint in BODY.joints.values()]
PERIOD = 0.005
"""Time between two messages of the simulated human [s]."""


def motion(time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return joint positions [rad], velocities [rad/s] and accelerations [rad/s^2] at a time [s]."""
    n = np.arange(1, len(JOINTS) + 1)
    w, share = 2.0 * np.pi * (0.3 + 0.05 * n), 0.15 * np.array([high - low for low, high in RANGES])
    phase = w * time + n
    middle = np.array([0.5 * (low + high) for low, high in RANGES])
    return middle + share * np.sin(phase), share * w * np.cos(phase), -share * w * w * np.sin(phase)


class Oracle:
    """Reference computation of the body by pinocchio, with its root on a free-flyer joint."""

    def __init__(self) -> None:
        self.model = pinocchio.buildModelFromXML(BODY.urdf, pinocchio.JointModelFreeFlyer())
        self.data = self.model.createData()
        self.root = HumanSettings.of(PERSON, "human").root(BODY)
        joints = [self.model.joints[self.model.getJointId(name)] for name in JOINTS]
        self._q, self._v = [joint.idx_q for joint in joints], [joint.idx_v for joint in joints]

    def state(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        q, dq, ddq = motion(time)
        own, v, a = np.zeros(self.model.nq), np.zeros(self.model.nv), np.zeros(self.model.nv)
        own[:3], own[3:7] = self.root.position, self.root.orientation
        own[self._q], v[self._v], a[self._v] = q, dq, ddq
        return own, v, a

    def point(self, time: float, link: str, p_link: Any) -> np.ndarray:
        """Return the position of a point of a link in the world [m]; p_link: the point in the link [m]."""
        pinocchio.framesForwardKinematics(self.model, self.data, self.state(time)[0])
        return np.asarray(self.data.oMf[self.model.getFrameId(link)].act(np.asarray(p_link)))

    def pressed(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return force [N] and torque about the world's origin [N m] of the body on the floor."""
        tau = pinocchio.rnea(self.model, self.data, *self.state(time))
        R = rotation_from_quaternion(self.root.orientation)
        force = -R @ tau[:3]
        return force, -R @ tau[3:6] + np.cross(self.root.position, force)


def joint_state(time: float) -> Any:
    q, dq, _ = motion(time)
    message = JointState(name=JOINTS, position=q.tolist(), velocity=dq.tolist())
    message.header.stamp = stamps.to_time(time)
    return message
