"""A marker beside the simulated arm: its samples at their own rate, with noise and gaps, as the motion capture node
would send them."""

import math

import numpy as np
from arm_rig import ArmRig
from geometry_msgs.msg import Point

from hric_core.robot_time import stamps
from hric_msgs.msg import MocapData, RigidBodyState

AMPLITUDE, FREQUENCY, RATE = 0.1, 0.25, 240.0
THESIS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def sinusoid(time):
    """Return the position of a marker that moves along one axis, in the base, shape (3,) [m]."""
    return np.array([0.0, AMPLITUDE * math.sin(2 * math.pi * FREQUENCY * time), 0.0])


class MarkerRig(ArmRig):
    """`follow(seconds)` runs the arm while the marker moves.

    Args:
        controller: name of the instance.
        way: marker's way in the base over time [s]; it is sent in the mocap frame of the thesis (y up).
        noise: standard deviation of each axis [m].
        seen: whether the marker is seen at a time [s].
        changes: parameters of the controller.

    Attributes:
        times, desired, measured, truth, velocity: of each cycle; positions in the base, shape (n, 3) [m].
    """

    def __init__(self, controller, way=sinusoid, noise=1e-4, seen=lambda time: True, **changes):
        super().__init__(controller, **changes)
        self.way, self.noise, self.seen = way, noise, seen
        self.point = changes.get("source") == "point"
        self.rng = np.random.default_rng(7)
        topic, kind = ("/mocap/marker", Point) if self.point else ("/hric/perception/mocap", MocapData)
        self.marker = self.node.advertise(topic, kind)
        self.frames = 0
        self.rows = []

    def follow(self, seconds):
        self.run(seconds, self._on_cycle)
        self.times, self.desired, self.measured, self.truth = (
            np.array(column) for column in zip(*self.rows, strict=True)
        )
        return self

    def _on_cycle(self, time):
        if self.frames / RATE <= time:
            self._send(self.frames / RATE)
            self.frames += 1
        state = self.state
        self.rows.append((time, state.O_T_EE_c[12:15], state.O_T_EE[12:15], self.way(time)))

    def _send(self, time):
        x, y, z = THESIS.T @ self.way(time) + self.rng.normal(0.0, self.noise, 3) + [1.0, 1.2, -0.5]
        if self.point:
            if self.seen(time):
                self.marker.publish(Point(x, y, z))
            return
        message = MocapData(frame_number=self.frames, tracking_valid=self.seen(time))
        message.header.frame_id, message.header.stamp = "mocap", stamps.to_time(time + 1e-9)
        body = RigidBodyState(name="hand", id=1, tracking_valid=self.seen(time))
        body.pose.position.x, body.pose.position.y, body.pose.position.z = x, y, z
        body.pose.orientation.w = 1.0
        message.rigid_bodies = [body]
        self.marker.publish(message)

    def figures(self, path):
        """Return the lag [s], the RMS error without it [m], and the RMS acceleration relative to the ideal one."""
        moved, truth, n = path - path[0], self.truth - self.truth[0], len(path)
        errors = [np.sqrt(np.mean(np.sum((moved[lag:] - truth[: n - lag]) ** 2, axis=1))) for lag in range(400)]
        lag = int(np.argmin(errors))
        acceleration, ideal = (
            np.sqrt(np.mean(np.sum(np.diff(way, n=2, axis=0) ** 2, axis=1))) for way in (moved, truth)
        )
        return lag * 1e-3, errors[lag], acceleration / ideal
