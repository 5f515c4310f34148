"""What the emulated cameras see: bodies, markers, plates, faults; and the pose of a body from its markers."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hric_core.errors import CommandError, HricError, ParameterError
from hric_core.geometry.poses import Pose, compose, transformed, z_up
from hric_core.geometry.quaternions import difference, from_rotation_vector
from mocap_natnet.codec import Codec
from mocap_natnet.codec.types import TRACKED
from mocap_natnet.rigid_body import Fit
from mocap_natnet.server import (
    CameraFaults,
    Motive,
    MotiveSettings,
    SceneBody,
    ServedPlate,
    ServedScene,
    SinusoidSource,
    Track,
    from_file,
)
from mocap_natnet.server.scene import TRIANGLE
from mocap_natnet.server.scene_file import load
from mocap_natnet.tracking.tracking import MAX_NAMES, Tracker
from mocap_natnet.tracking.validity import PoseValidator

TURNING = SinusoidSource((0.4, 0.1, 1.0), (0.1, 0.05, 0.02), 0.25, 0.0, (0.5, -0.4, 0.3))


def tracker(up: str, base: Pose | None = None) -> Tracker:
    return Tracker(up, base or Pose(), PoseValidator())


def random_pose(random: np.random.Generator) -> Pose:
    q = Rotation.random(rng=random).as_quat().tolist()
    return Pose(tuple(random.normal(size=3).tolist()), tuple(q))


def test_y_up_and_z_up_streams_give_the_same_motion_in_the_base() -> None:
    base = Pose((0.5, -0.2, 0.1), from_rotation_vector((0.1, 0.2, 1.2)))
    codec, found = Codec((4, 1)), {}
    for up in ("y", "z"):
        scene, judge = ServedScene((SceneBody("hand", TURNING),), up=up), tracker(up, base)
        judge.describe(codec.decode_model(codec.encode_model(scene.model())))
        frames = [codec.decode_frame(codec.encode_frame(scene.frame(n, n / 240, 1 / 240))) for n in range(480)]
        found[up] = [(judge.bodies(frame, n / 240, n / 240)[0], judge.markers(frame)) for n, frame in enumerate(frames)]
    for n, ((y, y_markers), (z, z_markers)) in enumerate(zip(found["y"], found["z"], strict=True)):
        assert y.valid and z.valid and y.name == "hand"
        truth = compose(base, TURNING(n / 240))
        assert math.dist(y.pose.position, z.pose.position) < 1e-6
        assert math.dist(y.pose.position, truth.position) < 1e-6
        assert math.hypot(*difference(y.pose.orientation, z.pose.orientation)) < 1e-6
        assert math.hypot(*difference(y.pose.orientation, truth.orientation)) < 1e-6
        for one, other in zip(y_markers, z_markers, strict=True):
            assert one.name == other.name and math.dist(one.position, other.position) < 1e-6
    assert [marker.name for marker in found["y"][0][1]] == ["hand/Marker1", "hand/Marker2", "hand/Marker3"]


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_body_from_three_markers_by_kabsch_is_the_streamed_one(up: str) -> None:
    codec, scene = Codec((4, 2)), ServedScene((SceneBody("hand", TURNING),), up=up)
    (body,) = codec.decode_model(codec.encode_model(scene.model())).bodies.values()
    for n in range(0, 960, 40):
        frame = codec.decode_frame(codec.encode_frame(scene.frame(n, n / 240, 1 / 240)))
        fit = Fit([marker.position for marker in body.markers], [marker.position for marker in frame.markers])
        assert fit.pose.position == pytest.approx(frame.bodies[0].position, abs=1e-6)
        assert math.hypot(*difference(fit.pose.orientation, frame.bodies[0].orientation)) < 1e-5
        assert fit.rms < 1e-6


def test_kabsch_agrees_with_scipy_under_noise() -> None:
    random = np.random.default_rng(2)
    for _ in range(20):
        points, pose = random.normal(size=(5, 3)), random_pose(random)
        seen = np.array([transformed(pose, tuple(p)) for p in points]) + 0.01 * random.normal(size=(5, 3))
        fit = Fit(points, seen)
        theirs, _ = Rotation.align_vectors(seen - seen.mean(axis=0), points - points.mean(axis=0))
        assert Rotation.from_quat(fit.pose.orientation).as_matrix() == pytest.approx(theirs.as_matrix(), abs=1e-9)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (TRIANGLE[:2], "three or more"),
        (((0, 0, 0), (1, 0, 0), (2, 0, 0)), "not collinear"),
        ((TRIANGLE[0], TRIANGLE[1], (math.nan, 0, 0)), "finite"),
    ],
)
def test_markers_that_give_no_pose_are_refused(points: tuple, words: str) -> None:
    with pytest.raises(CommandError, match=words):
        Fit(points, points)


def test_noise_has_the_requested_size_and_repeats_with_the_seed() -> None:
    def positions(seed: int) -> np.ndarray:
        scene = ServedScene((SceneBody("hand", Track([0.0], [Pose()])),), (), CameraFaults(noise=1e-4, seed=seed), "z")
        return np.array([scene.frame(n, n / 240, 1 / 240).bodies[0].position for n in range(2000)])

    assert positions(1).std(axis=0) == pytest.approx([1e-4] * 3, rel=0.1)
    assert np.array_equal(positions(1), positions(1)) and not np.array_equal(positions(1), positions(2))


def test_noise_of_a_frame_is_the_same_in_any_order_of_frames() -> None:
    faults = CameraFaults(noise=1e-3, rotation_noise=1e-3, marker_noise=1e-3)
    bodies = (SceneBody("hand", TURNING), SceneBody("tool", TURNING, 2))
    told, back = ServedScene(bodies, (), faults), ServedScene(bodies, (), faults)
    forwards = [told.frame(n, n / 100, 0.01) for n in range(200)]
    assert [back.frame(n, n / 100, 0.01) for n in reversed(range(200))] == forwards[::-1]
    positions = [marker.position for frame in forwards for marker in frame.markers]
    assert len(set(positions)) == len(positions) == 1200


def test_an_occluded_body_keeps_its_last_pose_without_the_flag_and_its_markers_are_gone() -> None:
    scene = ServedScene(
        (SceneBody("hand", TURNING), SceneBody("tool", TURNING, 2)), (), CameraFaults(occlusions=((0.5, 0.25, "hand"),))
    )
    seen = [scene.frame(n, n / 100, 0.01) for n in range(100)]
    assert [bool(frame.bodies[0].flags & TRACKED) for frame in seen] == [not 50 <= n < 75 for n in range(100)]
    assert all(frame.bodies[1].flags & TRACKED for frame in seen)
    assert seen[60].bodies[0].position == seen[49].bodies[0].position
    assert len(seen[60].markers) == 3 and len(seen[80].markers) == 6


def test_random_occlusions_have_the_requested_share() -> None:
    scene = ServedScene(
        (SceneBody("hand", TURNING),), (), CameraFaults(occlusion_rate=1.0, occlusion_length=0.25, seed=1)
    )
    hidden = [not scene.frame(n, n / 20, 0.05).bodies[0].flags & TRACKED for n in range(8000)]
    assert np.mean(hidden) == pytest.approx(0.25 / 1.25, abs=0.05)


def test_a_force_plate_streams_its_samples_and_its_description() -> None:
    scene = ServedScene((), (ServedPlate(lambda t: (t, 0.0, -700.0, 0.0, 0.0, 0.0), samples=4),))
    codec = Codec((4, 1))
    (plate,) = codec.decode_frame(codec.encode_frame(scene.frame(10, 1.0, 0.1))).force_plates
    assert plate.channels[0] == pytest.approx([0.925, 0.95, 0.975, 1.0])
    assert plate.channels[2] == (-700.0,) * 4
    described = codec.decode_model(codec.encode_model(scene.model())).descriptions[-1]
    assert described.channels == ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    assert {tuple(round(x, 6) for x in z_up("y", corner)) for corner in described.corners} == {
        (x, y, 0.0) for x in (0.3, -0.3) for y in (0.2, -0.2)
    }


def test_minimum_jerk_goes_from_rest_to_rest() -> None:
    track = Track(
        [1.0, 2.0],
        [Pose((0.0, 0.0, 0.0)), Pose((0.2, 0.0, 0.0), from_rotation_vector((0.0, 0.0, 1.0)))],
        minimum_jerk=True,
    )
    assert track(0.0).position == (0.0, 0.0, 0.0) and track(3.0).position == (0.2, 0.0, 0.0)
    assert track(1.5).position[0] == pytest.approx(0.1)
    assert math.hypot(*difference(track(1.5).orientation, (0.0, 0.0, 0.0, 1.0))) == pytest.approx(0.5)
    u = np.linspace(0, 1, 101)
    assert [track(1 + x).position[0] for x in u] == pytest.approx((0.2 * (10 * u**3 - 15 * u**4 + 6 * u**5)).tolist())


def test_a_trajectory_comes_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "track.csv"
    path.write_text("time,x,y,z,qx,qy,qz,qw\n0,0,0,1,0,0,0,1\n1,0.5,0,1,0,0,0,2\n")
    assert from_file(path)(0.5) == Pose((0.25, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,1,2\n", "line 1"),
        ("0,0,0,0\n0,1,1,1\n", "times of a motion must increase"),
        ("0,a,0,0\n", "line 1"),
        ("0,0,0,0,0,0,0,0\n", "zero"),
        ("", "at least one pose"),
    ],
)
def test_a_bad_trajectory_is_refused_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "track.csv"
    path.write_text(text)
    with pytest.raises(ParameterError, match=words):
        from_file(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("bodies: [{name: a, motion: {type: jump}}]", "minimum_jerk"),
        ("bodies: [{name: a, colour: red, motion: {type: still}}]", "colour"),
        ("bodies: [{name: a}]", "motion"),
        ("bodies: [{name: a, motion: {type: still}}, {name: a, motion: {type: still}}]", "share"),
        ("bodies: [{name: a, id: 0, motion: {type: still}}]", "streaming id 0"),
        ("bodies: [{name: a, motion: {type: still, position: [1, .nan, 0]}}]", "finite"),
        ("bodies: 3", "list"),
        ("{}", "neither"),
        ("[", "scene"),
    ],
)
def test_a_bad_scene_is_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    with pytest.raises(HricError, match=words):
        load(path, CameraFaults(), "y")


def test_implausible_poses_count_as_lost_by_reason() -> None:
    judge = PoseValidator(max_speed=5.0)
    good, q = Pose((0.0, 0.0, 1.0)), (0.0, 0.0, 0.0, 1.0)
    assert judge.accept(1, good, 0.0, 0.0) == good
    assert judge.accept(1, Pose((math.nan, 0.0, 1.0), q), 0.1, 0.1) is None
    assert judge.accept(1, Pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.9)), 0.1, 0.1) is None
    assert judge.accept(1, Pose((0.0, 0.0, 99.0), q), 0.1, 0.1) is None
    assert judge.accept(1, Pose((0.6, 0.0, 1.0), q), 0.1, 0.1) is None
    assert judge.refused == {"not finite": 1, "not a unit quaternion": 1, "outside the volume": 1, "too fast": 1}
    assert judge.accept(1, Pose((0.6, 0.0, 1.0), q), 0.13, 0.13) is not None


def test_a_frame_that_lies_about_its_time_cannot_make_a_jump_valid() -> None:
    judge = PoseValidator(max_speed=5.0)
    assert judge.accept(1, Pose(), 10.0, 10.0)
    assert judge.accept(1, Pose((1.0, 0.0, 0.0)), 19.0, 10.004) is None
    assert judge.accept(1, Pose((1.0, 0.0, 0.0)), 1.0, 10.008) is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate": 0.0},
        {"rate": math.nan},
        {"transport": "broadcast"},
        {"group": "10.0.0.1"},
        {"ip": "here"},
        {"loss": 1.5},
        {"version": (5, 0)},
    ],
)
def test_a_wrong_setting_is_refused_by_name(wrong: dict) -> None:
    with pytest.raises(HricError, match="5\\.0" if "version" in wrong else next(iter(wrong))):
        Motive(MotiveSettings(**wrong), ServedScene())


# -- what is told of ---------------------------------------------------------------------------------------------------


def test_a_body_that_the_description_lacks_is_left_out_and_counted() -> None:
    judge, scene = tracker("z"), ServedScene((SceneBody("hand", TURNING), SceneBody("tool", TURNING, 2)), up="z")
    judge.describe(ServedScene((SceneBody("hand", TURNING),), up="z").model())
    assert [body.name for body in judge.bodies(scene.frame(1, 0.01, 0.01), 0.01, 0.01)] == ["hand"]
    assert judge.validator.refused == {"not described": 1}


def test_without_a_description_bodies_have_the_names_of_their_numbers() -> None:
    judge, scene = tracker("z"), ServedScene((SceneBody("hand", TURNING), SceneBody("tool", TURNING, 2)), up="z")
    assert [body.name for body in judge.bodies(scene.frame(1, 0.01, 0.01), 0.01, 0.01)] == ["body_1", "body_2"]


def test_there_is_an_end_to_the_number_of_names_since_each_takes_a_topic() -> None:
    judge, still = tracker("z"), Track([0.0], [Pose()])
    told = sum(
        len(judge.bodies(ServedScene((SceneBody("x", still, number),), up="z").frame(1, 0.0, 0.01), number, number))
        for number in range(1, 700)
    )
    assert told == MAX_NAMES and judge.validator.refused == {"too many bodies": 699 - MAX_NAMES}
    assert len(judge.bodies(ServedScene((SceneBody("x", still, 1),), up="z").frame(2, 0.1, 0.01), 701.0, 701.0)) == 1
