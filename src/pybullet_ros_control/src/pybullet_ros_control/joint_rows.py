"""What a force on a link does in the joints of a body: rows of the transposed Jacobian of any point. (The engine's own is not that of the point.)"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet

from hric_control.plants.spatial import FloatArray, crossing, rotation_from_quaternion
from pybullet_ros_control.engine import Body


class JointRows:
    """The moving joints of one body, in the engine's order.

    Args:
        body: with a model.
        client: the engine's client.

    Attributes:
        joints: engine indices.
    """

    def __init__(self, body: Body, client: int) -> None:
        assert body.model is not None
        self._body, self._client = body, client
        self.joints = sorted(body.joints.values())
        names = {index: name for name, index in body.joints.items()}
        joints = [body.model.joints[names[index]] for index in self.joints]
        self._axes = np.array([joint.axis for joint in joints])
        self._slides = np.array([joint.type == "prismatic" for joint in joints])
        self._carries: dict[int, FloatArray] = {}
        self.forget()

    def forget(self) -> None:
        """The body has moved."""
        self._frames: tuple[FloatArray, FloatArray] | None = None

    def _joint_frames(self) -> tuple[FloatArray, FloatArray]:
        """(axes, origins) of all moving joints in the world, shape (n, 3) each; asked once per step."""
        if self._frames is None:
            states = pybullet.getLinkStates(self._body.id, self.joints, computeForwardKinematics=1, physicsClientId=self._client)
            rotations = np.array([rotation_from_quaternion(state[5]) for state in states])
            self._frames = np.einsum("nij,nj->ni", rotations, self._axes), np.array([state[4] for state in states])
        return self._frames

    def _carried_by(self, index: int) -> FloatArray:
        """1 for each moving joint between the base and a link, else 0."""
        if index not in self._carries:
            chain, link = set(), index
            while link >= 0:
                chain.add(link)
                link = self._body.parents[link]
            self._carries[index] = np.array([float(joint in chain) for joint in self.joints])
        return self._carries[index]

    def efforts(self, index: int, force: FloatArray, torque: Sequence[float] | None, point: FloatArray) -> FloatArray:
        """tau_i = a_i . ((p - o_i) x F + T) for a turning joint, a_i . F for a sliding one, shape (n,) [N m or N]."""
        axes, origins = self._joint_frames()
        moments = (point - origins) @ crossing(force)
        if torque is not None:
            moments += torque
        moments[self._slides] = force
        return np.asarray(self._carried_by(index) * np.einsum("ni,ni->n", axes, moments))
