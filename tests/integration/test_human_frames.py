"""TF frames of a simulated human, compared with the forward kinematics of the human's joints."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
import yaml
from live_system import ROOT, LiveSystem
from rosbags.highlevel import AnyReader

from hric_core.geometry import FloatArray, homogeneous
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_human.body import describe
from hric_human.participant.settings import HumanSettings

pytestmark = [pytest.mark.alone, pytest.mark.live]

EXPERIMENT = ROOT / "src/hric_experiments/config/experiments/hand_guidance.yaml"
LINKS = ("r_shoulder", "r_elbow", "r_wrist")


def three_seconds(folder: Path) -> Path:
    """Write the experiment hand_guidance, ending during the motion of the hand."""
    path = folder / "three_seconds.yaml"
    path.write_text(yaml.safe_dump(yaml.safe_load(EXPERIMENT.read_text()) | {"duration": 3.0}))
    return path


def messages(bag: Path, *topics: str) -> dict[str, list[Any]]:
    with AnyReader([bag]) as reader:
        found: dict[str, list[Any]] = {topic: [] for topic in topics}
        for connection, _, raw in reader.messages([c for c in reader.connections if c.topic in topics]):
            found[connection.topic].append(reader.deserialize(raw, connection.msgtype))
    return found


def place(transform: Any) -> FloatArray:
    """Return T_parent_child, shape (4, 4)."""
    p, q = transform.translation, transform.rotation
    return homogeneous(rotation_from_quaternion((q.x, q.y, q.z, q.w)), (p.x, p.y, p.z))


def in_world(frame: str, transforms: dict[str, tuple[str, FloatArray]]) -> FloatArray:
    """Return T_world_frame in a tree of child -> (parent, T_parent_child)."""
    T = np.eye(4)
    while frame != "world":
        frame, T_parent = transforms[frame][0], transforms[frame][1]
        T = T_parent @ T
    return T


def test_the_frames_of_a_human_are_where_pinocchio_puts_their_links(
    start: Callable[..., LiveSystem], tmp_path: Path
) -> None:
    system = start("env:=sim", "rviz:=false", "simulator:=mujoco", f"experiment:={three_seconds(tmp_path)}")
    assert system.wait(timeout=120.0) == 0, system.output
    (bag,) = system.run_folder.glob("*.bag")
    heard = messages(bag, "/tf", "/tf_static", "/hric/human/joint_states")

    settings = HumanSettings.of(yaml.safe_load(EXPERIMENT.read_text())["human"], "human")
    body = describe(settings.person)
    model = pinocchio.buildModelFromXML(body.urdf)
    data, root = model.createData(), settings.root(body)
    T_world_root = homogeneous(rotation_from_quaternion(root.orientation), root.position)
    angles = {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in heard["/hric/human/joint_states"]}

    fixed = {
        t.child_frame_id: (t.header.frame_id, place(t.transform)) for m in heard["/tf_static"] for t in m.transforms
    }
    compared, hands = 0, []
    for message in heard["/tf"]:
        own = {t.child_frame_id: (t.header.frame_id, place(t.transform)) for t in message.transforms}
        stamp = message.transforms[0].header.stamp
        state = angles.get((stamp.sec, stamp.nanosec))
        if "human/r_wrist" not in own or state is None:
            continue
        q = pinocchio.neutral(model)
        for name, angle in zip(state.name, state.position, strict=True):
            q[model.joints[model.getJointId(name)].idx_q] = angle
        pinocchio.framesForwardKinematics(model, data, q)
        for link in LINKS:
            expected = T_world_root @ data.oMf[model.getFrameId(link)].homogeneous
            np.testing.assert_allclose(in_world(f"human/{link}", own | fixed), expected, atol=1e-9)
        compared += 1
        hands.append(in_world("human/r_wrist", own | fixed)[:3, 3])
    print(f"{compared} sets of frames; the wrist went {np.ptp(hands, axis=0).max():.3f} m")
    assert compared > 30 and np.ptp(hands, axis=0).max() > 0.05
