"""A simulated person who moves in front of an emulated Motive's cameras, and the nodes that track them."""

import os
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from real_master import free_port
from sensor_msgs.msg import JointState
from sensor_nodes import Nodes, TellsTime, wait

from hric_core.robot_time import stamps
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

CLIENT = "../../mocap_natnet/nodes/natnet_client"
SOMEBODY: dict[str, Any] = {"subject": "P50_male", "parts": "upper_body", "position": [0.9, 0.1], "heading": 2.8}
SETTINGS = HumanSettings.of(SOMEBODY, "human")
BODY = describe(SETTINGS.person)
PERIOD = 0.005
FRAME_RATE = 120.0
BODY_OF_PERSON = "/hric/person/robot_description"
"""Parameter that the node `person` sets when it is about to process frames."""


def text_of(value: Any) -> str:
    return str(yaml.safe_dump(value, default_flow_style=True, width=10_000)).strip()


class Swings:
    """Publisher of a simulated person's joint states: joints swing about their middle, or all are zero.

    Args:
        run: clock of robot time.
        within: lower and upper angle by joint, for joints that swing in less than their range [rad].

    Attributes:
        still: robot time from which all joints are zero [s].
    """

    def __init__(self, run: TellsTime, within: Mapping[str, tuple[float, float]] | None = None) -> None:
        import rospy

        low, high = np.array([(within or {}).get(name, joint.range) for name, joint in BODY.joints.items()]).T
        high = np.minimum(high, np.radians(75))
        self._middle, self._swing = 0.5 * (low + high), 0.3 * (high - low)
        self._phase = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, len(low))
        self.still = np.inf
        self._run, self._stop = run, threading.Event()
        self._publisher = rospy.Publisher("/hric/human/joint_states", JointState, queue_size=100)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def joints(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return joint positions [rad] and velocities [rad/s] at a robot time [s]."""
        if time >= self.still:
            return np.zeros(len(self._middle)), np.zeros(len(self._middle))
        phase = 2.0 * time + self._phase
        return self._middle + self._swing * np.sin(phase), 2.0 * self._swing * np.cos(phase)

    def accelerations(self, time: float) -> np.ndarray:
        """Return joint accelerations at a robot time [s] while the joints swing [rad/s^2]."""
        return np.asarray(-4.0 * self._swing * np.sin(2.0 * time + self._phase))

    def _work(self) -> None:
        due = round(self._run.time / PERIOD)
        while not self._stop.wait(PERIOD):
            while due * PERIOD <= self._run.time:
                q, dq = self.joints(due * PERIOD)
                message = JointState(name=list(BODY.joints), position=q.tolist(), velocity=dq.tolist())
                message.header.stamp = stamps.to_time(due * PERIOD)
                self._publisher.publish(message)
                due += 1

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._publisher.unregister()


@pytest.fixture
def swings(run: TellsTime) -> Iterator[Swings]:
    made = Swings(run)
    yield made
    made.close()


def listen(topic: str, kind: type) -> list[Any]:
    import rospy

    seen: list[Any] = []
    rospy.Subscriber(topic, kind, seen.append, queue_size=None)
    return seen


def processor_time(pid: int) -> float:
    """Return the processor time of a process [s]: user and system, fields 14 and 15 of its stat (proc(5))."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def begin(nodes: Nodes, *arguments: str, **stream_keys: Any) -> Any:
    """Start the mocap client, the node `person` with arguments, and then the emulated Motive with stream settings."""
    import rospy

    ports = {"command_port": free_port(), "data_port": free_port()}
    stream = text_of({"transport": "unicast", "rate": FRAME_RATE, "marker_noise": 5e-4, **ports, **stream_keys})
    client = [f"_{name}:={port}" for name, port in ports.items()]
    nodes.start(CLIENT, "__name:=natnet_client", *client, "_local:=127.0.0.1", "_base_frame:=panda_link0")
    if rospy.has_param(BODY_OF_PERSON):  # of a test before
        rospy.delete_param(BODY_OF_PERSON)
    person = nodes.start("person", "_asset:=body", *arguments)
    wait(lambda: rospy.has_param(BODY_OF_PERSON))
    nodes.start("emulated_human", "_human:={program: body}", f"_stream:={stream}", f"_person:={text_of(SOMEBODY)}")
    return person
