"""The emulated Motive that sees the hand: the same motion arrives in the robot's base, whatever the axes and the place
of the mocap frame."""

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped

from hric_core.errors import HricError
from hric_core.local.node import LocalNode
from hric_msgs.msg import MocapData
from hric_perception.human import see
from hric_perception.human.truth import Truth
from mocap_natnet.headless import HeadlessMocap, robot_time
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher

HUMAN = {
    "program": "sinusoid",
    "amplitude": [0.03, 0.1, 0.05],
    "rotation": [0.3, 0.1, -0.2],
    "begin": 0.1,
    "still": {"table": [0.5, 0.3, 0.1]},
}
BASE = {"xyz": [1.0, -2.0, 0.3], "xyzw": [0.0, 0.0, math.sin(0.4), math.cos(0.4)]}


def seen(stream: dict[str, Any], base: dict[str, Any] | None = None, seed: int = 0) -> tuple[list[Any], list[Any]]:
    """Return (frames, true poses) of 2 s."""
    client = {"up_axis": stream.get("up_axis", "y"), "body": "hand"} | (
        {"base_from_mocap": base, "base_frame": "panda_link0"} if base else {}
    )
    node = LocalNode({"natnet_client": client})
    built = see(HUMAN, stream, base, seed)
    mocap = HeadlessMocap(built.motive, MocapPublisher(node, Publishing.read(node.child("natnet_client")), robot_time))
    truth = Truth(node, built.hand, "panda_link0")
    frames: list[Any] = []
    poses: list[Any] = []
    node.subscribe("/hric/perception/mocap", MocapData, frames.append)
    node.subscribe("/hric/human/hand", PoseStamped, poses.append)
    built.hand.start(0.0)
    for k in range(2000):
        mocap.advance(k * 1e-3)
        truth.advance(k * 1e-3)
    return frames, poses


def hand(pose: Any) -> list[float]:
    p, q = pose.position, pose.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("base", [BASE, {"xyz": [0, 0, 0]}], ids=["elsewhere", "in the base"])
def test_the_hand_arrives_in_the_base_as_it_moves(up: str, base: dict[str, Any]) -> None:
    frames, _ = seen({"up_axis": up}, base)
    assert len(frames) > 470
    for message in frames[::20]:
        true = see(HUMAN, {}, None, 0).hand
        true.start(0.0)
        position, orientation = true(message.header.stamp.to_sec())
        assert [body.name for body in message.rigid_bodies] == ["hand", "table"]
        assert hand(message.rigid_bodies[0].pose) == pytest.approx([*position, *orientation], abs=1e-6)
        assert hand(message.rigid_bodies[1].pose)[:3] == pytest.approx([0.5, 0.3, 0.1], abs=1e-6)


def test_the_truth_comes_at_100_hz_on_its_grid_with_its_own_stamps() -> None:
    _, poses = seen({"noise": 1e-3})
    assert [message.header.stamp.to_sec() for message in poses] == pytest.approx(np.arange(200) * 0.01, abs=1e-9)
    true = see(HUMAN, {}, None, 0).hand
    true.start(0.0)
    for message in poses[::10]:
        assert hand(message.pose) == pytest.approx(
            [part for parts in true(message.header.stamp.to_sec()) for part in parts], abs=1e-9
        )


def test_noise_and_occlusions_repeat_with_the_seed() -> None:
    stream = {"noise": 1e-4, "occlusions": [[0.5, 0.25]], "occlusion_rate": 1.0, "loss": 0.01}
    first, again, other = (
        [(m.frame_number, m.tracking_valid, hand(m.rigid_bodies[0].pose)) for m in seen(stream, seed=seed)[0]]
        for seed in (1, 1, 2)
    )
    assert first == again and first != other
    assert not any(valid for number, valid, _ in first if 0.5 <= number / 240 < 0.75)


BAD: dict[str, tuple[Any, Any, Any]] = {
    "mocap.stream.rate is 0; valid: a finite number from 1 to 1000": ({}, {"rate": 0}, None),
    "no parameter 'fps' in mocap.stream": ({}, {"fps": 1}, None),
    "mocap.stream.transport is 'tcp'; valid: unicast, multicast": ({}, {"transport": "tcp"}, None),
    "mocap.stream.up_axis is 'x'; valid: y, z": ({}, {"up_axis": "x"}, None),
    "mocap.stream.bitstream .*bitstream 9.9": ({}, {"bitstream": 9.9}, None),
    "mocap.stream.occlusions names the body 'head'; valid: hand": ({}, {"occlusions": [[1, 1, "head"]]}, None),
    r"mocap.stream.occlusions\[0\] is \[1\]; valid: a list of 2 finite numbers": ({}, {"occlusions": [[1]]}, None),
    "mocap.base_from_mocap.xyzw is .*; valid: a unit quaternion": ({}, {}, {"xyzw": [1, 1, 0, 0]}),
    "mocap.human.markers has 2 rows; valid: at least three": ({"markers": [[0, 0, 0], [1, 0, 0]]}, {}, None),
    "mocap.human.still.table is 3; valid: a list of 3 finite numbers": ({"still": {"table": 3}}, {}, None),
    "mocap.human is 'x'; valid: a mapping": ("x", {}, None),
}


@pytest.mark.parametrize("text", BAD)
def test_what_cannot_be_seen_is_refused_by_its_full_name(text: str) -> None:
    human, stream, base = BAD[text]
    with pytest.raises(HricError, match=text):
        see(human, stream, base, 0, "mocap.")
