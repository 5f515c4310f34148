"""Pose of a body's root link in the world over a run. No ROS."""

from dataclasses import dataclass

import numpy as np

from hric_bags.reader import FloatArray
from hric_core.geometry import Pose


@dataclass(frozen=True)
class RootRecord:
    """Pose of a body's root link over time.

    Attributes:
        time: rising robot time, shape (n,) [s].
        pose: position [m] and unit quaternion x y z w, shape (n, 7).
        fixed: True if the body does not move, so that one pose is enough.
        frame: tf frame of the poses; of several in a recording, all of them.
    """

    time: FloatArray
    pose: FloatArray
    fixed: bool = False
    frame: str = "world"

    @classmethod
    def still(cls, T_world_root: Pose) -> "RootRecord":
        """Return the record of a body that does not move; T_world_root: its pose in the world."""
        return cls(np.zeros(1), np.array([[*T_world_root.position, *T_world_root.orientation]]), fixed=True)

    def at(self, time: FloatArray) -> FloatArray:
        """Return positions [m] and unit quaternions at robot times, shape (n,) [s]: shape (n, 7).

        Interpolation is linear; before the first and after the last sample the pose is constant.
        """
        q = self.pose[:, 3:]
        flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
        smooth = np.vstack([q[:1], q[1:] * flips[:, None]])  # signs chosen so that the quaternions are continuous
        columns = np.hstack([self.pose[:, :3], smooth])
        pose = np.array([np.interp(time, self.time, column) for column in columns.T]).T
        norm = np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
        pose[:, 3:] /= np.where(norm > 0.0, norm, np.nan)
        return pose

    def transforms(self, time: FloatArray) -> FloatArray:
        """Return the poses T_world_root at robot times, shape (n,) [s]: shape (n, 4, 4)."""
        pose = self.at(time)
        x, y, z, w = pose[:, 3:].T
        T = np.tile(np.eye(4), (len(pose), 1, 1))
        T[:, :3, 3] = pose[:, :3]
        T[:, 0, :3] = np.array([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)]).T
        T[:, 1, :3] = np.array([2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)]).T
        T[:, 2, :3] = np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]).T
        return T
