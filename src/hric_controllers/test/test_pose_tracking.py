"""The desired pose never jumps, whatever messages arrive; without an arm."""

import logging
import math
import random
import struct
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped

from hric_control.speed_scale import SpeedScale
from hric_controllers.marker.pose_tracking import PoseTracking
from hric_core.local.node import LocalNode
from hric_msgs.msg import MocapData, RigidBodyState

START = [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.4, 0.0, 0.5, 1.0]
DT = 1e-3
ROUNDING = 10.0
"""The end of a motion is the target itself, 1e-9 m from where the last step leads; over three steps that counts as so
much jerk [m/s^3]."""
TRANSLATION, ROTATION = (0.7, 2.0, 50.0), (0.5, 4.0, 100.0)


def any_float(rng):
    """Bits at random, or a number of a size that is likely to pass."""
    if rng.random() < 0.3:
        return struct.unpack("<f", struct.pack("<I", rng.getrandbits(32)))[0]
    return rng.choice((0.02, 0.3, 3.0)) * rng.uniform(-1, 1)


def random_frame(rng):
    message = MocapData(tracking_valid=rng.random() < 0.5)
    message.header.stamp.secs, message.header.stamp.nsecs = (
        rng.choice((0, 5, rng.getrandbits(31))),
        rng.randrange(1_000_000_000),
    )
    message.header.frame_id = rng.choice(("mocap", "mocap", "panda_link0", "\xff"))
    for _ in range(rng.choice((0, 1, 1, 1, 2))):
        body = RigidBodyState(name=rng.choice(("hand", "", "\x00")), tracking_valid=rng.random() < 0.9)
        p, q = body.pose.position, body.pose.orientation
        p.x, p.y, p.z = any_float(rng), any_float(rng), any_float(rng)
        q.x, q.y, q.z, q.w = any_float(rng), any_float(rng), any_float(rng), any_float(rng)
        if rng.random() < 0.7:
            angle = rng.uniform(-1.5, 1.5)
            q.x, q.y, q.z, q.w = math.sin(angle), 0.0, 0.0, math.cos(angle)
        message.rigid_bodies.append(body)
    return message


def resident():
    """Memory of this process [bytes]."""
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])


class Watch:
    """Check of the desired poses' differences against the motion limits."""

    def __init__(self):
        self.velocity, self.acceleration = (
            {"position": (0.0,) * 3, "rotation": (0.0,) * 3},
            {"position": (0.0,) * 3, "rotation": (0.0,) * 3},
        )
        self.position = {}
        self.largest = {"position": [0.0] * 3, "rotation": [0.0] * 3}

    def look(self, name, position):
        last = self.position.get(name, position)
        velocity = tuple((b - a) / DT for a, b in zip(last, position, strict=True))
        acceleration = tuple((b - a) / DT for a, b in zip(self.velocity[name], velocity, strict=True))
        jerk = tuple((b - a) / DT for a, b in zip(self.acceleration[name], acceleration, strict=True))
        self.largest[name] = [
            max(old, math.hypot(*new))
            for old, new in zip(self.largest[name], (velocity, acceleration, jerk), strict=True)
        ]
        self.position[name], self.velocity[name], self.acceleration[name] = position, velocity, acceleration


@pytest.mark.parametrize("messages", [20_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("on_return", ["reanchor", "catch_up"])
def test_no_message_makes_the_setpoint_jump_or_the_memory_grow(messages, on_return, caplog):
    caplog.set_level(logging.CRITICAL, "hric")
    rng, watch = random.Random(11), Watch()
    params = {
        "follow": "pose",
        "on_return": on_return,
        "largest_step": 1.0,
        "lost_after": 0.01,
        "workspace": {"lower": [0.2, -0.3, 0.2]},
    }
    node = LocalNode({"c": params})
    tracking = PoseTracking(node.child("c"), "panda_link0", SpeedScale(), node.resolve)
    tracking.open()
    tracking.start(START)
    frames, commands = node.advertise("/hric/perception/mocap", MocapData), node.advertise("/c/command", PoseStamped)
    time, used = 0.0, 0
    for count in range(messages):
        frames.publish(random_frame(rng))
        if count % 1000 == 999:
            message = PoseStamped()
            message.pose.position.x, message.pose.position.y, message.pose.position.z = (
                rng.uniform(0.3, 0.5),
                rng.uniform(-0.2, 0.2),
                0.5,
            )
            message.pose.orientation.x = 1.0
            commands.publish(message)
        time += DT
        tracking.update(time, DT)
        watch.look("position", tracking.pose.position)
        watch.look("rotation", tuple(tracking._rotation.position))
        if count == messages // 4:
            used = resident()
    grown = resident() - used
    for name, limits in (("position", TRANSLATION), ("rotation", ROTATION)):
        velocity, acceleration, jerk = watch.largest[name]
        assert (
            velocity <= limits[0] * (1 + 1e-6)
            and acceleration <= limits[1] * (1 + 1e-4)
            and jerk <= limits[2] + ROUNDING
        ), name
        assert velocity > 0.05, name  # something did move
    assert 0.2 <= tracking.pose.position[0] <= 0.85
    assert len(tracking._follower.counts.refused) >= 5
    assert grown < 10e6
