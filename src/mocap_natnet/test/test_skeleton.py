"""A skeleton measured by the emulated cameras, decoded by this codec and by that of another author."""

import math

import pytest

from hric_core.errors import ParameterError
from hric_core.geometry.poses import Pose
from hric_core.geometry.quaternions import Vector, difference, from_rotation_vector
from mocap_natnet.codec import Codec
from mocap_natnet.codec.packets import HEADER
from mocap_natnet.codec.types import Suffix
from mocap_natnet.server import Bone, CameraFaults, SceneBody, ServedScene, ServedSkeleton, SinusoidSource
from mocap_natnet.tracking.tracking import Tracker
from mocap_natnet.tracking.validity import PoseValidator

BONES = (Bone("trunk"), Bone("upper_arm", "trunk", (0.0, -0.2, 0.4)), Bone("forearm", "upper_arm", (0.0, 0.0, -0.3)))
HAND = SceneBody("hand", SinusoidSource())


def where(time: float) -> tuple[list[Pose], list[Vector]]:
    """Bones and markers, z up."""
    turn = from_rotation_vector((0.1, 0.2, 0.3 + time))
    poses = [Pose((0.1 * k, -0.2, 1.0 + time), turn) for k in range(len(BONES))]
    return poses, [(0.5 + time, 0.25, 1.5), (0.25, 0.5, 1.25)]


def scene(**faults: object) -> ServedScene:
    return ServedScene(
        (HAND,), (), CameraFaults(**faults), "y", skeletons=(ServedSkeleton("S07", 3, BONES, ("RELB", "RWRA"), where),)
    )


@pytest.mark.parametrize("version", [(2, 7), (3, 0), (4, 0), (4, 1), (4, 2)])
def test_bones_and_labelled_markers_arrive_by_name_where_they_are(version: tuple[int, int]) -> None:
    codec, seen, tracker = Codec(version), scene(), Tracker("y", Pose(), PoseValidator())
    model = codec.decode_model(codec.encode_model(seen.model()))
    assert model.skipped == 0
    tracker.describe(model)
    frame = codec.decode_frame(codec.encode_frame(seen.frame(1, 0.25, 0.01)))
    poses, markers = where(0.25)
    for (name, found), bone, pose in zip(tracker.bones(frame), BONES, poses, strict=True):
        assert name == f"S07/{bone.name}"
        assert math.dist(found.position, pose.position) < 1e-6
        assert math.hypot(*difference(found.orientation, pose.orientation)) < 1e-6
    named = {marker.name: marker.position for marker in tracker.markers(frame)}
    assert named["S07/RELB"] == pytest.approx(markers[0], abs=1e-6)
    assert named["S07/RWRA"] == pytest.approx(markers[1], abs=1e-6)


@pytest.mark.parametrize("version", [(3, 0), (4, 0), (4, 1), (4, 2)])
def test_an_independent_reader_reads_the_skeleton_back(version: tuple[int, int]) -> None:
    natnet = pytest.importorskip("natnet")
    from natnet.packet_buffer import PacketBuffer

    codec, seen, other = Codec(version), scene(), natnet.Version(*version)
    model = natnet.DataDescriptions.read_from_buffer(
        PacketBuffer(codec.encode_model(seen.model())[HEADER.size :]), other
    )
    (described,) = model.skeletons
    assert (described.name, described.id_num) == ("S07", 3)
    bones = described.rigid_body_descriptions
    assert [(bone.name, bone.id_num, bone.parent_id) for bone in bones] == [
        ("trunk", 1, 0),
        ("upper_arm", 2, 1),
        ("forearm", 3, 2),
    ]
    assert bones[1].pos == pytest.approx((0.0, 0.4, 0.2))  # x, z, -y
    assert {one.name: one.marker_names for one in model.marker_sets}["S07"] == ("RELB", "RWRA")
    buffer = PacketBuffer(codec.encode_frame(seen.frame(1, 0.25, 0.01, Suffix(time_stamp=12.5)))[HEADER.size :])
    frame = natnet.DataFrame.read_from_buffer(buffer, other)
    (skeleton,) = frame.skeletons
    poses, markers = where(0.25)
    assert [body.id_num for body in skeleton.rigid_bodies] == [3 << 16 | number for number in (1, 2, 3)]
    for body, pose in zip(skeleton.rigid_bodies, poses, strict=True):
        x, y, z = pose.position
        assert body.pos == pytest.approx((x, z, -y), abs=1e-6) and body.tracking_valid
    labelled = {(one.model_id, one.marker_id): one.pos for one in frame.labeled_markers}
    for number, (x, y, z) in enumerate(markers, 1):
        assert labelled[3, number] == pytest.approx((x, z, -y), abs=1e-6)
    assert frame.suffix.timestamp == 12.5, "what comes behind is read from its beginning on"


def test_an_occlusion_hides_the_skeleton_as_a_whole_and_noise_repeats_with_the_seed() -> None:
    seen = scene(occlusions=[[0.2, 0.1, "S07"]])
    frame = seen.frame(1, 0.25, 0.01)
    assert {bone.flags for bone in frame.skeletons[0].bodies} == {0}
    assert {marker.id >> 16 for marker in frame.markers} == {HAND.id}
    first, again, other = (scene(noise=1e-3, marker_noise=1e-3, seed=seed).frame(7, 0.5, 0.01) for seed in (1, 1, 2))
    assert first.skeletons == again.skeletons and first.markers == again.markers
    assert first.skeletons != other.skeletons and first.markers[-1] != other.markers[-1]
    exact = scene().frame(7, 0.5, 0.01)
    assert 0.0 < math.dist(first.markers[-1].position, exact.markers[-1].position) < 1e-2


def test_a_skeleton_that_cannot_be_is_refused() -> None:
    with pytest.raises(
        ParameterError, match="bone 'forearm' of S07 has the parent 'upper_arm'; valid: a bone listed before it"
    ):
        ServedSkeleton("S07", 3, BONES[2:], (), where)
    with pytest.raises(ParameterError, match=r"share one of the streaming ids: hand \(1\), S07 \(1\)"):
        ServedScene((HAND,), skeletons=(ServedSkeleton("S07", 1, BONES, (), where),))
