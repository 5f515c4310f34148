"""Publishes topics for a synchroniser at the rates of a data collection: `python sync_feed.py SECONDS FORM`.

Each value is the time of its sample since the start [s].

The robot at 1 kHz, a body at 240 Hz, 8 channels of EMG at 2 kHz and a plate at 1 kHz. FORM is one of: `as recorded`:
the control log with 20 cycles per message, EMG and plate in chunks of 10 ms; `joint states`: the same, but a JointState
per cycle; `per sample`: no message holds two samples, as filters without chunks need it. Prints how many samples of
each it sent.
"""

import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import genpy
import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from hric_msgs.msg import ControlLog, MocapData, RigidBodyState, SampleChunk

NS = 1_000_000_000
JOINTS = [f"panda_joint{index}" for index in range(1, 8)]
MUSCLES = [f"EMG{index}" for index in range(1, 9)]
AXES = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
RECORDED, STATES, SINGLE = "as recorded", "joint states", "per sample"
FORMS = (RECORDED, STATES, SINGLE)


class Feed(NamedTuple):
    """A topic.

    Attributes:
        topic: name of the topic.
        rate: messages per second [Hz].
        samples: number of samples per message.
        make: function (stamp of the first sample [s], stamp of the start [s], number of the message) -> message.
    """

    topic: str
    rate: float
    samples: int
    make: Callable[[float, float, int], Any]


def joints(stamp: float, begin: float, number: int) -> Any:
    """Return a JointState whose values are the time since the start [s]."""
    code = stamp - begin
    return JointState(name=JOINTS, position=[code] * 7, velocity=[code] * 7, effort=[code] * 7)


def log(stamp: float, begin: float, number: int) -> Any:
    """Return a ControlLog with 20 cycles whose values are the time since the start [s]."""
    times = [stamp - begin + 0.001 * index for index in range(20)]
    codes = [time for time in times for _ in JOINTS]
    return ControlLog(
        joint_names=JOINTS,
        n_cycles=20,
        time=times,
        position=codes,
        velocity=codes,
        effort=codes,
        command=codes,
        command_raw=codes,
    )


def bodies(stamp: float, begin: float, number: int) -> Any:
    """Return a MocapData with one body whose x is the time since the start [s]."""
    body = RigidBodyState(name="hand", id=1, tracking_valid=True)
    body.pose.position.x, body.pose.orientation.w = stamp - begin, 1.0
    return MocapData(frame_number=number, tracking_valid=True, rigid_bodies=[body])


def chunk(channels: list[str], unit: str, rate: float, samples: int) -> Callable[[float, float, int], Any]:
    """Return a function that makes a SampleChunk whose values are the time since the start [s]."""

    def make(stamp: float, begin: float, number: int) -> Any:
        data = [stamp - begin + index / rate for index in range(samples) for _ in channels]
        return SampleChunk(
            source="feed", channels=channels, unit=unit, rate=rate, first_sample=number * samples, data=data
        )

    return make


def wrench(stamp: float, begin: float, number: int) -> Any:
    """Return a WrenchStamped whose force is the time since the start [s]."""
    message = WrenchStamped()
    message.wrench.force.x = stamp - begin
    return message


def feeds(form: str) -> list[Feed]:
    """Return all topics of a form (see the module)."""
    robot = Feed("/control_log", 50.0, 20, log) if form == RECORDED else Feed("/joint_states", 1000.0, 1, joints)
    fixed = [robot, Feed("/hric/perception/mocap", 240.0, 1, bodies)]
    if form == SINGLE:
        emg = Feed("/hric/perception/emg/raw", 2000.0, 1, chunk(MUSCLES, "V", 2000.0, 1))
        return [*fixed, emg, Feed("/hric/perception/force_plate/1/wrench", 1000.0, 1, wrench)]
    emg = Feed("/hric/perception/emg/raw", 100.0, 20, chunk(MUSCLES, "V", 2000.0, 20))
    return [*fixed, emg, Feed("/hric/perception/force_plate/1/samples", 100.0, 10, chunk(AXES, "-", 1000.0, 10))]


def send(feeds: list[Feed], seconds: float) -> list[int]:
    """Publish in real time, each message at the time of its last sample; return the number of samples by topic."""
    publishers = [rospy.Publisher(feed.topic, type(feed.make(0.0, 0.0, 0)), queue_size=1000) for feed in feeds]
    while any(publisher.get_num_connections() == 0 for publisher in publishers) and not rospy.is_shutdown():
        time.sleep(0.05)
    time.sleep(0.5)
    begin, monotonic = time.time(), time.monotonic()
    counts = [0] * len(feeds)
    while (elapsed := time.monotonic() - monotonic) < seconds:
        for index, (feed, publisher) in enumerate(zip(feeds, publishers, strict=True)):
            while (counts[index] + 1) / feed.rate <= elapsed:
                offset = counts[index] / feed.rate
                message = feed.make(begin + offset, begin, counts[index])
                message.header.stamp = genpy.Time(*divmod(round((begin + offset) * 1e6) * 1000, NS))
                publisher.publish(message)
                counts[index] += 1
        time.sleep(0.0005)
    time.sleep(0.5)
    return [count * feed.samples for count, feed in zip(counts, feeds, strict=True)]


if __name__ == "__main__":
    rospy.init_node("feed", disable_signals=True)
    chosen = feeds(sys.argv[2])
    for feed, count in zip(chosen, send(chosen, float(sys.argv[1])), strict=True):
        print(feed.topic, count)
