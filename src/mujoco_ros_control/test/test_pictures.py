"""The camera sees a ball at the pixel and the distance that its CameraInfo predicts."""

from collections.abc import Callable, Iterator
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from hric_core.errors import HricError
from hric_core.geometry import FloatArray, homogeneous
from hric_core.urdf import read
from hric_human.participant.settings import HumanSettings
from hric_skin import fitted
from mujoco_ros_control.pictures import BACKGROUND, Camera, CameraSettings, camera_matrix, optical_frame

RADIUS = 0.1
BALL = np.array([0.6, 0.7, 0.4])
"""Beside the arm, in the world frame [m]."""
AHEAD = CameraSettings(width=320, height=240, xyz=(0.6, -1.3, 0.3), rpy=(0.0, 0.0, 0.5 * np.pi))
"""Looks along y."""
Make = Callable[..., Camera]


@pytest.fixture
def make_camera(panda_urdf: str, tmp_path: Path) -> Iterator[Make]:
    path, cameras = tmp_path / "ball.yaml", []
    path.write_text(
        f"objects:\n- {{name: ball, shape: sphere, size: [{RADIUS}], mass: 1.0, pose: {{xyz: {BALL.tolist()}}}}}\n"
    )

    def make(settings: CameraSettings) -> Camera:
        cameras.append(Camera(panda_urdf, str(path), settings))
        return cameras[-1]

    yield make
    for camera in cameras:
        camera.close()


def seen(settings: CameraSettings, point: FloatArray) -> tuple[FloatArray, float]:
    """Pixel (right, down) and distance along the axis [m] of a point in the camera's parent, by the pinhole model."""
    x = np.linalg.inv(optical_frame(settings.T_parent_camera)) @ [*point, 1.0]
    pixel = np.reshape(camera_matrix(settings), (3, 3)) @ (x[:3] / x[2])
    return pixel[:2], float(x[2])


def rotation_z(angle: float) -> FloatArray:
    """Return the rotation matrix about z, shape (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def where(distances: FloatArray, low: float, high: float) -> FloatArray:
    """Return the centre of the pixels (right, down) whose distance is within a range [m]."""
    rows, columns = np.nonzero((distances > low) & (distances < high))
    return np.array([columns.mean(), rows.mean()])


def test_a_ball_stands_where_the_camera_matrix_says_and_as_far_as_it_is(make_camera: Make) -> None:
    picture, distances = make_camera(AHEAD).take({}, {}, depth=True)
    assert picture.shape == (240, 320, 3) and distances is not None and distances.shape == (240, 320)
    pixel, middle = seen(AHEAD, BALL)
    found = where(distances, middle - 1.01 * RADIUS, middle)
    assert np.abs(found - pixel).max() < 0.5
    assert distances[round(pixel[1]), round(pixel[0])] == pytest.approx(middle - RADIUS, abs=1e-3)
    nothing = np.isinf(distances)
    assert nothing[0, 0] and (picture[nothing] == BACKGROUND).all() and (picture[~nothing] != BACKGROUND).any()


def test_a_ball_that_moves_is_seen_where_it_was_said_to_be(make_camera: Make) -> None:
    there = BALL + np.array([0.3, -0.4, 0.1])
    _, distances = make_camera(AHEAD).take({}, {"ball": homogeneous(np.eye(3), there)}, depth=True)
    assert distances is not None
    pixel, middle = seen(AHEAD, there)
    assert np.abs(where(distances, middle - 1.01 * RADIUS, middle) - pixel).max() < 0.5


LIFT = """<robot name="lift"><link name="base"/><link name="crank">{0}</link>
<link name="cage">{0}<visual><geometry><sphere radius="{1}"/></geometry></visual></link>
<joint name="turn" type="continuous"><parent link="base"/><child link="crank"/></joint>
<joint name="slide" type="prismatic"><origin xyz="0.6 0.7 0.4"/><axis xyz="0 0 1"/><parent link="base"/>
<child link="cage"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
<mimic joint="turn" multiplier="0.5" offset="0.1"/></joint></robot>""".format(
    '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>', RADIUS
)


def test_a_joint_that_mimics_another_is_drawn_where_its_law_has_it() -> None:
    camera = Camera(LIFT, "", AHEAD)
    try:
        _, distances = camera.take({"turn": -0.4}, {}, depth=True)
    finally:
        camera.close()
    assert distances is not None
    pixel, middle = seen(AHEAD, BALL + np.array([0.0, 0.0, -0.1]))
    assert np.abs(where(distances, middle - 1.01 * RADIUS, middle) - pixel).max() < 0.5


@pytest.mark.parametrize("q1", [0.0, 0.2])
def test_a_camera_on_a_link_moves_with_the_arm(make_camera: Make, q1: float) -> None:
    on_shoulder = CameraSettings(width=320, height=240, parent="panda_link1", xyz=(0.2, 0.2, 0.1), rpy=(0.0, 0.0, 0.8))
    _, distances = make_camera(on_shoulder).take({"panda_joint1": q1}, {}, depth=True)
    assert distances is not None
    T_world_link1 = homogeneous(rotation_z(q1), np.array([0.0, 0.0, 0.333]))
    in_link1 = np.linalg.inv(T_world_link1) @ [*BALL, 1.0]
    pixel, middle = seen(on_shoulder, in_link1[:3])
    assert np.abs(where(distances, middle - 1.01 * RADIUS, middle) - pixel).max() < 2.0


def test_a_parent_that_is_not_there_is_refused_with_those_that_are(make_camera: Make) -> None:
    with pytest.raises(HricError, match=r"panda::nowhere.*panda::panda_link0"):
        make_camera(CameraSettings(parent="nowhere"))


PERSON = HumanSettings.of({"subject": "P50_male", "parts": "whole_body", "position": [0.6, 0.9]}, "human")
"""Beside the arm, in front of the camera that looks along y; they look towards -x."""
ANGLES = {"right_sh_abd": 1.4, "left_el_flex": 0.8, "trunk_flex": 0.3}


def silhouette(points: FloatArray, triangles: Any, settings: CameraSettings) -> Any:
    """Return the mask of the pixels that triangles cover, from vertices in the world, shape (n, 3)."""
    T_optical = np.linalg.inv(optical_frame(settings.T_parent_camera))
    x = points @ T_optical[:3, :3].T + T_optical[:3, 3]
    pixels = (x / x[:, 2:]) @ np.reshape(camera_matrix(settings), (3, 3)).T
    image = Image.new("1", (settings.width, settings.height))
    for corners in pixels[triangles][:, :, :2]:
        ImageDraw.Draw(image).polygon([tuple(corner) for corner in corners], fill=1)
    return np.array(image)


@pytest.mark.parametrize("root", [None, homogeneous(rotation_z(1.0), np.array([0.7, 1.2, 0.2]))])
def test_the_person_is_drawn_where_their_skin_is(root: FloatArray | None) -> None:
    camera = Camera(LIFT, "", AHEAD, PERSON)
    try:
        picture, distances = camera.take({}, {} if root is None else {"human": root}, ANGLES, depth=True)
    finally:
        camera.close()
    body = PERSON.body()
    start = PERSON.root(body)
    T_world_root = homogeneous(rotation_z(PERSON.heading), np.array(start.position)) if root is None else root
    skin = fitted(body)
    vertices = skin.posed(read(body.urdf).poses(ANGLES)) @ T_world_root[:3, :3].T + T_world_root[:3, 3]
    expected = silhouette(vertices, skin.triangles, AHEAD)
    assert distances is not None
    ball = seen(AHEAD, BALL)[0]
    rows, columns = np.indices(distances.shape)
    away = np.hypot(columns - ball[0], rows - ball[1]) > 60.0  # the lift's cage
    drawn = np.isfinite(distances) & away
    assert np.mean(drawn[away] != expected[away]) < 0.01 and drawn.any()
    assert len(np.unique(picture[drawn] // 64, axis=0)) > 3  # clothes of several colours


def test_without_a_person_nobody_is_drawn() -> None:
    camera = Camera('<robot name="r"><link name="base"/></robot>', "", AHEAD)
    try:
        _, distances = camera.take({}, {}, {"right_sh_abd": 1.0}, depth=True)
    finally:
        camera.close()
    assert distances is not None and np.isinf(distances).all()


def test_another_thread_and_a_fork_are_refused_instead_of_waiting_forever(make_camera: Make) -> None:
    camera, errors, fork = make_camera(CameraSettings()), list[str](), get_context("fork")

    def refused(work: Callable[[], object], put: Callable[[str], object]) -> None:
        with pytest.raises(HricError) as error:
            work()
        put(str(error.value))

    thread = Thread(target=refused, args=(lambda: camera.take({}, {}, {}, depth=False), errors.append))
    thread.start()
    thread.join()
    assert "valid: one thread" in errors[0]
    queue = fork.SimpleQueue()
    child = fork.Process(target=refused, args=(lambda: make_camera(CameraSettings()), queue.put))
    child.start()
    child.join(60.0)
    child.kill()
    assert child.exitcode == 0 and "a process started by spawn" in queue.get()
