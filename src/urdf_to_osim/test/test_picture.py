"""Pictures show the contents of the model at the right places, and are made without a display."""

import io
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import matplotlib.image
import numpy as np
import opensim
import pinocchio
import pytest

import panda_description
import urdf_to_osim
from hric_core.command import main
from hric_core.errors import DescriptionError, ParameterError
from hric_core.geometry import FloatArray
from urdf_to_osim.decorations import Decoration, Look, load_scene
from urdf_to_osim.drawing.drawing import draw
from urdf_to_osim.drawing.picture import picture

pytestmark = pytest.mark.slow
NODE = Path(__file__).resolve().parents[1] / "nodes" / "picture"
# R_ground_base: z of the description along y of OpenSim's ground.
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
BALL_BLACK = 60
"""Only the black quarters of the balls are darker, and rims of round bodies [of 255]."""
FLOOR = 170
"""The lines of the floor, and the background, are brighter [of 255]."""


def slider(
    tmp_path: Path, *geometry: opensim.Geometry, com: tuple[float, float, float] = (0.0, 0.0, 0.0), gravity: int = 1
) -> Path:
    """A body of 1 kg that slides along x; gravity against axis number `gravity`."""
    model = opensim.Model()
    body = opensim.Body("cart", 1.0, opensim.Vec3(*com), opensim.Inertia(1.0))
    model.addBody(body)
    joint = opensim.SliderJoint("slide", model.getGround(), body)
    joint.updCoordinate().setName("x")
    model.addJoint(joint)
    for piece in geometry:
        body.attachGeometry(piece)
    down = [0.0, 0.0, 0.0]
    down[gravity] = -9.81
    model.setGravity(opensim.Vec3(*down))
    model.finalizeConnections()
    path = tmp_path / "cart.osim"
    model.printToXML(str(path))
    return path


@pytest.fixture(scope="module")
def panda(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("panda")
    conversion = urdf_to_osim.convert(panda_description.load())
    urdf_to_osim.write(conversion, folder / "panda.osim", cache=folder / "cache")
    return folder / "panda.osim"


def pixels(png: bytes) -> FloatArray:
    """The brightest channel from 0 to 255, so that no colour counts as dark, shape (height, width)."""
    return np.asarray(
        matplotlib.image.imread(io.BytesIO(png), format="png")[:, :, :3].max(axis=2) * 255.0, dtype=np.float64
    )


def by_kind(path: Path, pose: dict[str, float] | None = None) -> dict[str, Decoration]:
    return {decoration.kind: decoration for decoration in load_scene(path, pose).decorations}


def test_each_form_is_found_with_its_size_colour_and_place(tmp_path: Path) -> None:
    brick, ball = opensim.Brick(opensim.Vec3(0.1, 0.2, 0.3)), opensim.Sphere(0.05)
    brick.set_scale_factors(opensim.Vec3(1.0, 2.0, 3.0))
    brick.setColor(opensim.Vec3(0.1, 0.2, 0.3))
    brick.setOpacity(0.5)
    path = slider(tmp_path, brick, ball, opensim.Cylinder(0.1, 0.4), opensim.Ellipsoid(0.1, 0.2, 0.3))
    forms = by_kind(path, {"x": 0.7})
    assert forms["brick"].size == pytest.approx((0.1, 0.4, 0.9))
    assert (forms["brick"].colour, forms["brick"].opacity) == (pytest.approx((0.1, 0.2, 0.3)), 0.5)
    assert forms["sphere"].size == (0.05, 0.05, 0.05)
    assert forms["cylinder"].size == (0.1, 0.4, 0.1)
    assert forms["ellipsoid"].size == (0.1, 0.2, 0.3)
    assert all(
        np.allclose(form.T_ground, [[1, 0, 0, 0.7], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        for form in forms.values()
    )


def test_a_mesh_is_found_beside_the_model_and_a_missing_one_is_reported(tmp_path: Path) -> None:
    (tmp_path / "Geometry").mkdir()
    (tmp_path / "Geometry/there.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene = load_scene(slider(tmp_path, opensim.Mesh("there.obj"), opensim.Mesh("gone.obj")))
    assert [Path(decoration.file).name for decoration in scene.decorations] == ["there.obj"]
    assert scene.missing == ["gone.obj"]


def test_the_path_of_a_muscle_is_a_line_between_its_points(tmp_path: Path) -> None:
    model = opensim.Model(str(slider(tmp_path)))
    muscle = opensim.Thelen2003Muscle("muscle", 100.0, 0.1, 0.2, 0.0)
    muscle.addNewPathPoint("origin", model.updGround(), opensim.Vec3(0.0, 0.3, 0.0))
    muscle.addNewPathPoint("insertion", model.updBodySet().get("cart"), opensim.Vec3(0.0, 0.0, 0.1))
    model.addForce(muscle)
    model.finalizeConnections()
    model.printToXML(str(tmp_path / "cart.osim"))
    line = by_kind(tmp_path / "cart.osim", {"x": 0.5})["line"]
    ends = np.array(line.size).reshape(2, 3) @ line.T_ground[:3, :3].T + line.T_ground[:3, 3]
    assert np.allclose(ends, [[0.0, 0.3, 0.0], [0.5, 0.0, 0.1]])


def test_the_pandas_centres_of_mass_and_frames_stand_where_a_rigid_body_library_has_them(panda: Path) -> None:
    description = panda_description.load()
    model = pinocchio.buildModelFromXML(description)
    coms = {link.get("name"): link.find("inertial/origin") for link in ElementTree.fromstring(description).iter("link")}
    data = model.createData()
    q = np.array([0.3, -0.5, 0.2, -1.8, 0.4, 1.6, -0.7])
    scene = load_scene(panda, {f"panda_joint{i + 1}": float(value) for i, value in enumerate(q)})
    pinocchio.framesForwardKinematics(model, data, q)
    bodies = [frame for frame in model.frames if frame.type == pinocchio.FrameType.BODY and frame.name in scene.centres]
    assert len(bodies) == len(scene.centres) == 11
    for frame in bodies:
        placement = data.oMf[model.getFrameId(frame.name, pinocchio.FrameType.BODY)]
        centre = UPRIGHT @ placement.act(np.array(coms[frame.name].get("xyz").split(), float))
        assert np.allclose(scene.frames[frame.name][:3, 3], UPRIGHT @ placement.translation, atol=1e-12), frame.name
        assert np.allclose(scene.centres[frame.name][:3, 3], centre, atol=1e-12), frame.name
    assert scene.up == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize("gravity", [1, 2])
def test_a_ball_is_drawn_where_the_centre_of_mass_is_and_up_is_against_gravity(gravity: int, tmp_path: Path) -> None:
    com = [0.0, 0.0, 0.0]
    com[gravity] = 0.3
    path = slider(tmp_path, opensim.Brick(opensim.Vec3(0.4)), com=(com[0], com[1], com[2]), gravity=gravity)
    image = pixels(draw(load_scene(path), Look(300, 300, azimuth=20.0, elevation=0.0)))
    rows, columns = np.nonzero(image < BALL_BLACK)
    # The middle of the picture is the middle of the brick, of 0.8 m; the ball stands 0.3 m above it, inside.
    brick = np.nonzero(np.abs(image[:, 150] - image[2, 150]) > 8.0)[0]
    half_height = (brick.max() - brick.min()) / 2.0
    assert (150.0 - rows.mean()) / half_height == pytest.approx(0.3 / 0.4, abs=0.2)
    assert columns.mean() == pytest.approx(150.0, abs=3.0)
    bare = pixels(draw(load_scene(path), Look(300, 300, azimuth=20.0, elevation=0.0, centres=False)))
    assert not (bare < BALL_BLACK).any()


@pytest.mark.parametrize(
    ("size", "view"), [((200, 500), (0.0, 0.0)), ((500, 200), (120.0, 89.0)), ((300, 300), (-60.0, -90.0))]
)
def test_the_whole_model_is_in_the_picture(size: tuple[int, int], view: tuple[float, float], panda: Path) -> None:
    image = pixels(draw(load_scene(panda), Look(*size, *view, centres=False)))
    assert image.shape == size[::-1]
    edges = np.concatenate([image[:2].ravel(), image[-2:].ravel(), image[:, :2].ravel(), image[:, -2:].ravel()])
    # At the edges there is nothing but the background and the lines of the floor.
    assert edges.min() > FLOOR
    assert (image < FLOOR).sum() > 200


def test_frames_are_drawn_on_request(panda: Path) -> None:
    scene = load_scene(panda)
    images = [draw(scene, Look(200, 200, frames=frames)) for frames in (False, False, True)]
    assert images[0] == images[1] != images[2]


def run(*words: object, **variables: str) -> subprocess.CompletedProcess[str]:
    """The node in a process of its own, without a display and without what a desktop sets."""
    kept = {
        name: os.environ[name]
        for name in ("PATH", "PYTHONPATH", "VIRTUAL_ENV", "ROS_PACKAGE_PATH")
        if name in os.environ
    }
    environment = kept | {"PYTHONPATH": os.pathsep.join(sys.path), "HOME": "/nonexistent"} | variables
    return subprocess.run(
        [sys.executable, str(NODE), *map(str, words)], env=environment, capture_output=True, text=True, timeout=120
    )


def test_the_command_draws_the_panda_without_a_display(panda: Path, tmp_path: Path) -> None:
    result = run(
        panda,
        "-o",
        tmp_path / "a.png",
        "--pose",
        "panda_joint4=-1.5",
        "panda_joint6=1.5",
        "--size",
        320,
        240,
        "--view",
        30,
        20,
    )
    assert (result.returncode, result.stdout.strip(), result.stderr) == (0, str(tmp_path / "a.png"), "")
    image = pixels((tmp_path / "a.png").read_bytes())
    assert image.shape == (240, 320)
    assert (image < BALL_BLACK).sum() > 20
    assert os.listdir(tmp_path) == ["a.png"]


def test_without_the_library_that_draws_one_line_says_which_package_has_it(panda: Path, tmp_path: Path) -> None:
    (tmp_path / "libEGL.so.1").write_text("")
    result = run(panda, "-o", tmp_path / "a.png", LD_LIBRARY_PATH=str(tmp_path))
    assert result.returncode == 1
    assert "libegl1" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--pose", "nothing=1"], "no coordinate 'nothing' in the model; valid: x"),
        (["--pose", "x"], "--pose x: it must be COORDINATE=VALUE"),
        (["--pose", "x=far"], "--pose x=far: it must be COORDINATE=VALUE"),
        (["--pose", "x=nan"], "coordinate x: nan is not a finite number"),
        (["--size", "0", "100"], "width is 0"),
        (["--size", "100", "100000"], "height is 100000"),
        (["--view", "0", "91"], "elevation is 91"),
    ],
)
def test_a_mistake_gives_one_line_and_no_picture(
    words: list[str], error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = slider(tmp_path)
    assert main(["picture", str(path), *words]) == 2
    said = capsys.readouterr().err
    assert error in said
    assert len(said.splitlines()) == 1
    assert [found.name for found in tmp_path.iterdir()] == ["cart.osim"]


def test_a_picture_that_cannot_be_written_is_a_failure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["picture", str(slider(tmp_path)), "-o", "/no/such/folder/a.png"]) == 1
    assert "cannot write /no/such/folder/a.png" in capsys.readouterr().err


@pytest.mark.parametrize("content", [None, "", "no xml", "<a/>", "<OpenSimDocument Version='40000'></OpenSimDocument>"])
def test_a_file_that_is_no_model_is_refused_by_name(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / "a.osim"
    if content is not None:
        path.write_text(content)
    with pytest.raises(DescriptionError, match=r"a\.osim"):
        picture(path, tmp_path / "a.png")
    assert not (tmp_path / "a.png").exists()


def test_a_coordinate_that_the_model_locks_is_not_moved_silently(tmp_path: Path) -> None:
    model = opensim.Model(str(slider(tmp_path)))
    coordinate = model.updCoordinateSet().get("x")
    coordinate.setDefaultLocked(True)
    model.printToXML(str(tmp_path / "cart.osim"))
    with pytest.raises(ParameterError, match="coordinate x cannot be 2: the model locks it"):
        load_scene(tmp_path / "cart.osim", {"x": 2.0})
