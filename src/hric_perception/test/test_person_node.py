"""The node `person` with a real NatNet connection: an emulated Motive streams a person who moves."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from before_cameras import BODY, FRAME_RATE, SETTINGS, Swings, begin, listen, processor_time, swings
from real_master import ros, roscore
from sensor_msgs.msg import JointState
from sensor_nodes import Nodes, nodes, run, wait
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from hric_human.control.whole_body import WholeBody
from hric_msgs.msg import MocapData, PersonTracking
from hric_perception.person.settings import PersonSettings

__all__ = ["nodes", "ros", "roscore", "run", "swings"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
Figure = Callable[[str, float, str], None]


def test_joints_of_somebody_before_the_cameras_are_those_that_the_person_has_and_a_still_pose_calibrates(
    swings: Swings, nodes: Nodes, tmp_path: Path
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
    wait(lambda: len(captured) > came + 5 * FRAME_RATE)
    taken = states[first:]
    off = errors(taken, swings)
    assert len(off) == len(taken)
    assert np.median(off, axis=0).max() <= 1.0  # a machine that stands still for a moment gives wrong stamps
    assert not tracked[-1].calibrated and np.median([message.residual for message in tracked]) < 8e-4
    check_hand(frames, swings)
    calibrate = rospy.ServiceProxy("/person/calibrate", Trigger)
    refused = calibrate()
    assert not refused.success and "the person has moved: " in refused.message and not path.exists()
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


@pytest.mark.live
def test_sixty_estimates_and_more_come_a_second(swings: Swings, nodes: Nodes, figure: Figure) -> None:
    states, tracked = listen("/hric/person/joint_states", JointState), listen("/hric/person/tracking", PersonTracking)
    process = begin(nodes)
    wait(lambda: len(states) > 60)
    first, before = len(states), processor_time(process.pid)
    begun = states[-1].header.stamp.to_sec()
    wait(lambda: states[-1].header.stamp.to_sec() > begun + 5.0)
    span = states[-1].header.stamp.to_sec() - begun
    rate = (len(states) - first) / span
    rms = np.sqrt(np.square(errors(states[first:], swings)).mean(axis=0)).max()
    figure("person, live at 120 Hz: joint angles, rms of the worst joint", rms, "deg")
    figure("person, live at 120 Hz: share of a processor", (processor_time(process.pid) - before) / span, "1")
    figure("person, live at 120 Hz: rate of estimates", rate, "Hz")
    figure("person, live at 120 Hz: frames dropped", tracked[-1].dropped, "1")
    assert rate >= 60.0 and rms <= 2.0


def errors(states: list[Any], swings: Swings) -> np.ndarray:
    """Return errors of the estimated joint positions at their stamps, shape (complete estimates, joints) [deg]."""
    whole = [message for message in states if len(message.name) == len(BODY.joints)]
    return np.degrees(
        [np.abs(np.array(message.position) - swings.joints(message.header.stamp.to_sec())[0]) for message in whole]
    )


def check_hand(frames: list[Any], swings: Swings) -> None:
    """The person's frames are where their links are, in the median: single stamps are late on a busy machine."""
    errors = []
    for sent in [message for message in frames if message.transforms[0].child_frame_id.startswith("person/")][-60:]:
        assert {one.header.frame_id for one in sent.transforms} == {"panda_link0"}
        found = {one.child_frame_id: one.transform.translation for one in sent.transforms}
        q = swings.joints(sent.transforms[0].header.stamp.to_sec())[0]
        true = WholeBody(BODY).poses(q.tolist(), SETTINGS.root(BODY))["r_wrist"].position
        p = found["person/r_wrist"]
        errors.append(np.abs(np.subtract([p.x, p.y, p.z], true)).max())
    assert np.median(errors) < 2e-3


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
    output = process.communicate(timeout=180)[0]
    assert process.returncode == 2 and says in output and "Traceback" not in output
