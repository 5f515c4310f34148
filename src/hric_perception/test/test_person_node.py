"""The node `person` behind a real NatNet connection: an emulated Motive streams somebody who moves."""

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from sensor_msgs.msg import JointState
from sensor_nodes import Nodes, TellsTime, nodes, run, wait
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from hric_control.robot_time import stamps
from hric_control.testing import free_port, ros, roscore
from hric_human.body import describe
from hric_human.control.whole_body import WholeBody
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import MocapData, PersonTracking
from hric_perception.person.settings import PersonSettings

__all__ = ["nodes", "ros", "roscore", "run"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
Figure = Callable[[str, float, str], None]
CLIENT = "../../mocap_natnet/nodes/natnet_client"
SOMEBODY: dict[str, Any] = {"subject": "P50_male", "parts": "upper_body", "position": [0.9, 0.1], "heading": 2.8}
SETTINGS = HumanSettings.of(SOMEBODY, "human")
BODY = describe(SETTINGS.person)
PERIOD = 0.005
FRAME_RATE = 120.0


def text_of(value: Any) -> str:
    return str(yaml.safe_dump(value, default_flow_style=True, width=10_000)).strip()


class Swings:
    """Publishes joint states as if from a plant: joints swing about their middle, or all are zero.

    Attributes:
        still: from when on they are zero [s].
    """

    def __init__(self, run: TellsTime) -> None:
        import rospy

        low, high = np.array([joint.range for joint in BODY.joints.values()]).T
        high = np.minimum(high, np.radians(75))
        self._middle, self._swing = 0.5 * (low + high), 0.3 * (high - low)
        self._phase = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, len(low))
        self.still = np.inf
        self._run, self._stop = run, threading.Event()
        self._publisher = rospy.Publisher("/hric/human/joint_states", JointState, queue_size=100)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def joints(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions [rad] and velocities [rad/s]."""
        if time >= self.still:
            return np.zeros(len(self._middle)), np.zeros(len(self._middle))
        phase = 2.0 * time + self._phase
        return self._middle + self._swing * np.sin(phase), 2.0 * self._swing * np.cos(phase)

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
    """Of a process [s]: user and system, fields 14 and 15 of its stat (proc(5))."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def begin(nodes: Nodes, *arguments: str) -> Any:
    """Motive, its client, and the node."""
    ports = {"command_port": free_port(), "data_port": free_port()}
    stream = text_of({"transport": "unicast", "rate": FRAME_RATE, "marker_noise": 5e-4, **ports})
    nodes.start("emulated_human", "_human:={program: body}", f"_stream:={stream}", f"_person:={text_of(SOMEBODY)}")
    client = [f"_{name}:={port}" for name, port in ports.items()]
    nodes.start(CLIENT, "__name:=natnet_client", *client, "_local:=127.0.0.1", "_base_frame:=panda_link0")
    return nodes.start("person", "_asset:=body", *arguments)


def test_joints_of_somebody_before_the_cameras_are_those_that_he_has_and_a_still_pose_calibrates(
    swings: Swings, nodes: Nodes, tmp_path: Path, figure: Figure
) -> None:
    import rospy

    states, tracked, frames = (
        listen("/hric/person/joint_states", JointState),
        listen("/hric/person/tracking", PersonTracking),
        listen("/tf", TFMessage),
    )
    captured, path = listen("/hric/perception/mocap", MocapData), tmp_path / "calibrated.yaml"
    process = begin(nodes, f"_calibration:={path}")
    wait(lambda: len(states) > 60 and captured[-1].latency > 0.0)
    first, came = len(states), len(captured)
    before = processor_time(process.pid)
    wait(lambda: len(captured) > came + 5 * FRAME_RATE)
    taken, span = states[first:], states[-1].header.stamp.to_sec() - states[first].header.stamp.to_sec()
    figure("person, live at 120 Hz: share of a processor", (processor_time(process.pid) - before) / span, "1")
    figure("person, live at 120 Hz: rate of estimates", (len(taken) - 1) / span, "Hz")
    figure("person, live at 120 Hz: frames dropped", tracked[-1].dropped, "1")
    assert (len(taken) - 1) / span >= 60.0
    off = [
        np.degrees(np.abs(np.array(message.position) - swings.joints(message.header.stamp.to_sec())[0]))
        for message in taken
        if len(message.name) == len(BODY.joints)
    ]
    assert len(off) == len(taken)
    figure("person, live at 120 Hz: joint angles, rms of the worst joint", np.sqrt(np.square(off).mean(0)).max(), "deg")
    assert np.sqrt(np.square(off).mean(axis=0)).max() <= 2.0
    assert not tracked[-1].calibrated and tracked[-1].residual < 1e-3
    check_hand(frames, swings)
    calibrate = rospy.ServiceProxy("/person/calibrate", Trigger)
    refused = calibrate()
    assert not refused.success and "he has moved: " in refused.message and not path.exists()
    swings.still = states[-1].header.stamp.to_sec() + 0.5
    wait(lambda: states[-1].header.stamp.to_sec() > swings.still + 0.3)
    response = calibrate()
    assert response.success, response.message
    wait(lambda: tracked[-1].calibrated)
    known, calibrated = PersonSettings.of({"calibration": str(path)}, "person").known()
    assert calibrated and known.segments["right_forearm"].length == pytest.approx(
        BODY.segments["right_forearm"].length, rel=0.02
    )
    assert "Traceback" not in nodes.end(process)


def check_hand(frames: list[Any], swings: Swings) -> None:
    """His frames are where his links are."""
    sent = [message for message in frames if message.transforms[0].child_frame_id.startswith("person/")][-1]
    found = {one.child_frame_id: one.transform.translation for one in sent.transforms}
    q = swings.joints(sent.transforms[0].header.stamp.to_sec())[0]
    true = WholeBody(BODY).poses(q.tolist(), SETTINGS.root(BODY))["r_wrist"].position
    p = found["person/r_wrist"]
    assert [p.x, p.y, p.z] == pytest.approx(true, abs=0.01)
    assert {one.header.frame_id for one in sent.transforms} == {"panda_link0"}


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("_parts:=right_arm", "parts"),
        ("_markers:=[RELB, NOSE]", "NOSE"),
        ("_markers:=[RELB, RFIN, C7]", "1 markers are on the trunk"),
    ],
)
def test_a_body_that_markers_cannot_show_is_refused(ros: str, nodes: Nodes, argument: str, says: str) -> None:
    process = nodes.start("person", argument)
    output = process.communicate(timeout=30)[0]
    assert process.returncode == 2 and says in output and "Traceback" not in output
