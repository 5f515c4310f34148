"""From the emulated Motive to the setpoints of the arm, through the client, its publisher and the controller."""

import logging
import math

import numpy as np
import pytest
import rosbag
from mocap_rig import MOCAP, NAME, STATE, MocapRig

from hric_core.geometry.quaternions import from_rotation_vector, rotated
from hric_run.bag_writer import BagWriter
from mocap_natnet.server import CameraFaults, Motive, MotiveSettings, SceneBody, ServedScene, SinusoidSource

BASE = {
    "base_frame": "panda_link0",
    "base_from_mocap": {"xyz": [0.5, -0.2, 0.1], "xyzw": list(from_rotation_vector((0.1, -0.2, 0.9)))},
}
MOVING = SinusoidSource((0.4, 0.1, 1.0), (0.03, 0.08, -0.05), 0.25, 0.0, (0.4, 0.2, -0.3))
"""All three axes and all three angles; z up."""


def motive(up="y", faults=None, source=MOVING, **settings):
    return Motive(
        MotiveSettings(**settings), ServedScene((SceneBody("hand", source),), (), faults or CameraFaults(), up)
    )


def way(bench):
    """Return the displacement of the desired position from the start, shape (n, 3) [m]."""
    return bench.desired - bench.desired[0]


# -- axes --------------------------------------------------------------------------------------------------------------


def test_streams_with_y_up_and_with_z_up_are_the_same_motion_in_the_base():
    y, z = (MocapRig(motive(up), {**BASE, "up_axis": up}, follow="pose").follow(1.2) for up in ("y", "z"))
    assert np.abs(y.desired - z.desired).max() < 1e-6
    assert np.abs(np.subtract(y.state.O_T_EE_c, z.state.O_T_EE_c)).max() < 1e-6
    turned = rotated(from_rotation_vector((0.1, -0.2, 0.9)), (0.03, 0.08, -0.05))
    assert np.dot(way(y)[-1], turned) / np.linalg.norm(way(y)[-1]) / math.hypot(*turned) == pytest.approx(1.0, abs=1e-3)
    assert np.ptp(np.linalg.norm(way(y), axis=1)) > 0.05


def test_the_frame_rotation_of_the_thesis_makes_the_same_of_a_stream_with_y_up():
    thesis = MocapRig(motive("y"), {"up_axis": "y"}).follow(1.2)
    plain = MocapRig(motive("z"), {"up_axis": "z"}, frame_rotation=[[1, 0, 0], [0, 1, 0], [0, 0, 1]]).follow(1.2)
    assert np.abs(thesis.desired - plain.desired).max() < 1e-6
    assert np.ptp(np.linalg.norm(way(thesis), axis=1)) > 0.05


# -- occlusion ---------------------------------------------------------------------------------------------------------

BEGIN, LENGTH = 1.2, 0.5


def occluded(**changes):
    hidden = CameraFaults(noise=1e-4, occlusions=((BEGIN, LENGTH, ""),))
    return MocapRig(motive(faults=hidden, source=SinusoidSource((0.0, 0.0, 1.0), (0.0, 0.1, 0.0))), **changes)


@pytest.mark.parametrize("changes", [{}, {"on_return": "catch_up", "follow": "pose"}], ids=["again", "catching up"])
def test_in_an_occlusion_of_half_a_second_it_stops_within_its_limits_and_does_not_jump_on_return(changes):
    bench = occluded(**changes).follow(2.6)
    bench.check_within_limits()
    resting = bench.desired[(bench.times > BEGIN + 0.3) & (bench.times < BEGIN + LENGTH)]
    assert np.ptp(resting, axis=0).max() == 0.0
    assert np.linalg.norm(bench.desired[-1] - resting[-1]) > 0.03  # and goes on
    assert bench.last_state().tracking == "following" and bench.last_state().losses == 1


def test_the_log_and_the_bag_say_that_the_marker_was_lost(tmp_path, caplog):
    bench = occluded()
    with caplog.at_level(logging.INFO, "hric"), BagWriter(tmp_path / "run.bag") as bag:
        bench.node.tap(bag.write)
        bench.follow(2.2)
    said = [record.getMessage() for record in caplog.records]
    for words in (
        "hand: tracking lost",
        "hand: tracked",
        "the marker is lost: no valid sample for 10",
        "the marker is back",
    ):
        assert any(words in line for line in said), words
    with rosbag.Bag(str(tmp_path / "run.bag")) as bag:
        frames = [message for _, message, _ in bag.read_messages([MOCAP])]
        states = [message for _, message, _ in bag.read_messages([STATE])]
    invalid = [message.header.stamp.to_sec() for message in frames if not message.tracking_valid]
    assert (invalid[0], invalid[-1]) == pytest.approx((BEGIN, BEGIN + LENGTH), abs=1 / 200)
    assert len(invalid) == LENGTH * 240
    assert [message.frame_number for message in frames] == list(
        range(frames[0].frame_number, frames[0].frame_number + len(frames))
    )
    lost = [message.header.stamp.to_sec() for message in states if message.tracking == "lost"]
    assert lost[0] == pytest.approx(BEGIN + 0.1, abs=0.03) and lost[-1] == pytest.approx(BEGIN + LENGTH, abs=0.03)
    assert states[-1].losses == 1


# -- faults of the server ----------------------------------------------------------------------------------------------


def restarted(link):
    link.serving = False
    link.run(0.7)
    link.replace(motive(epoch=9000.0))
    link.serving = True


FAULTS = {
    "the server begins again": restarted,
    "the bitstream changes, and a frame says so": lambda link: link.motive.change_version((3, 0)),
    "the bitstream changes unsaid": lambda link: setattr(link.motive, "_version", (2, 9)),
    "the scene changes": lambda link: link.motive.change_scene(
        ServedScene((SceneBody("tool", SinusoidSource(), 7), SceneBody("hand", MOVING, 8)), up="y")
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_happens_to_the_server_moves_nothing_by_a_jump_and_the_marker_is_followed_again_within_two_seconds(fault):
    bench = MocapRig(motive(), body="hand").follow(0.6)
    FAULTS[fault](bench.link)
    before = bench.last_state().header.stamp.to_sec()
    bench.follow(0.3)
    there = bench.desired[-1]
    bench.follow(1.7)
    bench.check_within_limits()
    assert bench.last_state().tracking == "following", NAME
    assert np.linalg.norm(bench.desired[-1] - there) > 0.02
    assert bench.last_state().header.stamp.to_sec() - before > 1.9
