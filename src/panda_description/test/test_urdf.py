"""The URDF that load() returns is accepted by other tools and contains what was requested."""

import logging
import shutil
import subprocess
import sys
import time
from math import pi
from pathlib import Path
from urllib.parse import unquote, urlparse
from xml.etree import ElementTree

import numpy as np
import pinocchio
import PyKDL
import pytest
from numpy.testing import assert_allclose

import panda_description
from hric_core.errors import DescriptionError, ParameterError, UnknownNameError
from hric_core.geometry import steiner_term
from hric_core.urdf import read
from panda_description import parameters

SETS = ("barycentric", "fr3", "thesis")
MODELS = {"arm": {"hand": False}, "hand": {"hand": True}, "fingers": {"fingers": "prismatic"}}


def parse(**arguments: object) -> ElementTree.Element:
    return ElementTree.fromstring(panda_description.load(**arguments))


def numbers(element: ElementTree.Element | None, attribute: str) -> list[float]:
    assert element is not None
    return [float(text) for text in element.attrib[attribute].split()]


def link_inertials(robot: ElementTree.Element) -> dict[str, tuple[float, list[float], np.ndarray]]:
    """Mass, com and tensor of each link that has them, by link name."""
    found = {}
    for link in robot.iter("link"):
        if (inertial := link.find("inertial")) is not None:
            xx, xy, xz, yy, yz, zz = (
                float(inertial.find("inertia").attrib[key]) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
            )
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            found[link.attrib["name"]] = (
                float(inertial.find("mass").attrib["value"]),
                numbers(inertial.find("origin"), "xyz"),
                tensor,
            )
    return found


def kdl_body(robot: ElementTree.Element) -> PyKDL.RigidBodyInertia:
    """All moving links as one rigid body in the frame of link 0, every joint at 0."""
    inertials = link_inertials(robot)
    placed = {"panda_link0": PyKDL.Frame.Identity()}
    body = PyKDL.RigidBodyInertia()
    for joint in robot.findall("joint"):
        parent, child = joint.find("parent").attrib["link"], joint.find("child").attrib["link"]
        if parent in placed:
            origin = joint.find("origin")
            step = PyKDL.Frame(PyKDL.Rotation.RPY(*numbers(origin, "rpy")), PyKDL.Vector(*numbers(origin, "xyz")))
            placed[child] = placed[parent] * step
            mass, com, tensor = inertials[child]
            about_com = PyKDL.RotationalInertia(
                tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]
            )
            body = body + placed[child] * PyKDL.RigidBodyInertia(mass, PyKDL.Vector(*com), about_com)
    return body


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("inertials", SETS)
def test_check_urdf_accepts_the_output(model: str, inertials: str, tmp_path: Path) -> None:
    tool = shutil.which("check_urdf")
    assert tool, "check_urdf of Debian's liburdfdom-tools is missing"
    path = tmp_path / "panda.urdf"
    path.write_text(panda_description.load(inertials=inertials, **MODELS[model]))
    done = subprocess.run([tool, str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Successfully Parsed XML" in done.stdout


@pytest.mark.parametrize(("model", "joints", "tool"), [("arm", 7, 0.0), ("hand", 7, 0.76), ("fingers", 9, 0.76)])
@pytest.mark.parametrize("inertials", SETS)
def test_pinocchio_and_kdl_agree_on_moving_mass_and_centre(
    model: str, joints: int, tool: float, inertials: str
) -> None:
    text = panda_description.load(inertials=inertials, **MODELS[model])
    mass = tool + (15.4948010252 if inertials == "fr3" else 16.062132)
    built = pinocchio.buildModelFromXML(text)
    body = kdl_body(ElementTree.fromstring(text))
    com = pinocchio.centerOfMass(built, built.createData(), np.zeros(joints))
    assert built.nq == joints
    assert_allclose([pinocchio.computeTotalMass(built), body.getMass()], mass, rtol=0, atol=1e-12)
    assert_allclose([body.getCOG()[i] for i in range(3)], com, rtol=0, atol=1e-12)


@pytest.mark.parametrize("inertials", SETS)
def test_the_urdf_has_the_inertials_of_the_set_in_full_precision(inertials: str) -> None:
    found = link_inertials(parse(inertials=inertials))
    for part, expected in panda_description.inertials(inertials).items():
        for name in [f"panda_{part}"] if part != "finger" else ["panda_leftfinger", "panda_rightfinger"]:
            mass, com, tensor = found.pop(name)
            assert mass == expected.mass
            assert_allclose(com, expected.com, rtol=0, atol=0)
            assert_allclose(tensor, expected.inertia, rtol=0, atol=1e-15)
    assert sorted(found) == ["panda_hand_tcp", "panda_link8"]


def test_the_thesis_set_is_equation_2_applied_to_the_published_tensors() -> None:
    published, found = panda_description.inertials("barycentric"), link_inertials(parse(inertials="thesis"))
    for i in range(1, 8):
        mass, com, tensor = found[f"panda_link{i}"]
        assert_allclose(tensor, published[f"link{i}"].inertia - steiner_term(mass, np.array(com)), rtol=0, atol=1e-15)
    assert found["panda_link1"][1][2] == -0.175


def test_frames_without_mass_say_so_and_the_world_has_no_inertial() -> None:
    found = link_inertials(parse())
    for name in ("panda_link8", "panda_hand_tcp"):
        assert found[name][0] == 0.0
        assert not found[name][2].any()
    assert "world" not in found


@pytest.mark.parametrize("limits", parameters.LIMIT_SETS)
def test_limits_of_the_urdf_equal_the_yaml(limits: str) -> None:
    robot = parse(limits=limits)
    for name, limit in panda_description.joint_limits(limits=limits).items():
        joint = robot.find(f"joint[@name='{name}']")
        said = {key: float(value) for key, value in joint.find("limit").attrib.items()}
        assert said == {"lower": limit.lower, "upper": limit.upper, "velocity": limit.velocity, "effort": limit.effort}
        soft = {key: float(value) for key, value in joint.find("safety_controller").attrib.items()}
        assert soft == {
            "k_position": 100.0,
            "k_velocity": 40.0,
            "soft_lower_limit": limit.lower,
            "soft_upper_limit": limit.upper,
        }


def test_poses_of_joints_follow_the_published_kinematics() -> None:
    model = pinocchio.buildModelFromXML(panda_description.load())
    data = model.createData()
    q = np.array([0.1, -0.4, 0.3, -1.9, 0.5, 1.6, 0.7])
    pinocchio.framesForwardKinematics(model, data, q)
    dh = [
        (0, 0, 0.333),
        (0, -pi / 2, 0),
        (0, pi / 2, 0.316),
        (0.0825, pi / 2, 0),
        (-0.0825, -pi / 2, 0.384),
        (0, pi / 2, 0),
        (0.088, pi / 2, 0),
    ]
    pose = np.eye(4)
    for i, ((a, alpha, d), angle) in enumerate(zip([*dh, (0, 0, 0.107)], [*q, 0.0], strict=True), start=1):
        ca, sa, c, s = np.cos(alpha), np.sin(alpha), np.cos(angle), np.sin(angle)
        pose = pose @ np.array(
            [[c, -s, 0, a], [s * ca, c * ca, -sa, -d * sa], [s * sa, c * sa, ca, d * ca], [0, 0, 0, 1]]
        )
        assert_allclose(data.oMf[model.getFrameId(f"panda_link{i}")].homogeneous, pose, rtol=0, atol=1e-12)


def test_the_mounting_pose_moves_the_base_and_takes_text_or_numbers() -> None:
    for xyz, rpy in (("0.1 -0.2 0.5", "0 3.0 1.5"), ([0.1, -0.2, 0.5], [0, 3.0, 1.5])):
        origin = parse(xyz=xyz, rpy=rpy).find("joint[@name='robot_to_world']/origin")
        assert numbers(origin, "xyz") == [0.1, -0.2, 0.5]
        assert numbers(origin, "rpy") == [0.0, 3.0, 1.5]


def test_arm_id_is_the_prefix_of_every_name() -> None:
    robot = parse(arm_id="left_arm", fingers="prismatic")
    assert robot.attrib["name"] == "left_arm"
    names = [element.attrib["name"] for kind in ("link", "joint", "transmission") for element in robot.findall(kind)]
    assert [name for name in names if not name.startswith("left_arm_")] == ["world", "robot_to_world"]
    assert robot.find("joint[@name='left_arm_finger_joint2']/mimic").attrib["joint"] == "left_arm_finger_joint1"


def test_damping_and_friction_reach_every_joint_and_default_to_zero() -> None:
    plain = [joint.attrib for joint in parse().findall("joint/dynamics")]
    assert [(float(d["damping"]), float(d["friction"])) for d in plain] == [(0.0, 0.0)] * 7
    dynamics = [joint.attrib for joint in parse(damping=1, friction="identified").findall("joint/dynamics")]
    assert [float(d["damping"]) for d in dynamics] == [1.0] * 7
    assert [float(d["friction"]) for d in dynamics] == [0.2450, 0.1523, 0.1827, 0.3591, 0.2669, 0.1658, 0.2109]


def test_each_joint_has_a_transmission_with_the_requested_interfaces() -> None:
    robot = parse(hardware_interface="EffortJointInterface PositionJointInterface")
    assert [t.find("joint").attrib["name"] for t in robot.findall("transmission")] == [
        f"panda_joint{i}" for i in range(1, 8)
    ]
    for transmission in robot.findall("transmission"):
        assert transmission.findtext("type") == "transmission_interface/SimpleTransmission"
        for part in ("joint", "actuator"):
            said = [element.text for element in transmission.findall(f"{part}/hardwareInterface")]
            assert said == ["hardware_interface/EffortJointInterface", "hardware_interface/PositionJointInterface"]
        assert float(transmission.findtext("actuator/mechanicalReduction")) == 1.0


@pytest.mark.parametrize("inertials", ["barycentric", "fr3"])
def test_each_actuator_states_the_published_rotor_inertia(inertials: str) -> None:
    joints = read(panda_description.load(inertials=inertials, meshes=False)).joints
    stated = [joints[f"panda_joint{i}"].rotor_inertia for i in range(1, 8)]
    assert tuple(stated) == panda_description.rotor_inertia()
    assert stated[:6:2] == [0.605721456, 0.462474144, 0.205544064]


def test_the_plugin_element_names_the_simulated_robot() -> None:
    plugin = parse(robot_sim_type="pybullet_ros_control/RobotHWSim").find("gazebo/plugin")
    assert plugin.attrib["name"] == "gazebo_ros_control"
    assert plugin.findtext("robotSimType") == "pybullet_ros_control/RobotHWSim"


def test_meshes_are_files_on_this_disk() -> None:
    robot = parse()
    uris = [mesh.attrib["filename"] for mesh in robot.iter("mesh")]
    assert len(uris) == 11
    for uri in uris:
        assert uri.startswith("file:///")
        assert Path(unquote(urlparse(uri).path)).is_file()
    assert robot.findall(".//collision//mesh") == []


def test_without_the_meshes_package_primitives_are_drawn_and_one_warning_says_why(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    parameters.folder_uri.cache_clear()
    with caplog.at_level(logging.WARNING, "hric"):
        first, _again = parse(), parse()
    parameters.folder_uri.cache_clear()
    assert list(first.iter("mesh")) == []
    assert len(first.findall("link/visual")) == len(first.findall("link/collision")) > 0
    assert [record.message for record in caplog.records if "pybullet_data" in record.message] == [
        record.message for record in caplog.records
    ]
    assert len(caplog.records) == 1


def test_collision_can_be_left_out() -> None:
    assert parse(collision=False).findall("link/collision") == []


def test_the_output_is_pure_urdf() -> None:
    text = panda_description.load()
    assert "xacro" not in text
    assert "${" not in text
    assert "<!--" not in text


def test_loading_the_thesis_set_warns_which_links_are_not_physical_and_why(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "hric"):
        panda_description.load()
        assert caplog.records == []
        panda_description.load(inertials="thesis")
    (record,) = caplog.records
    text = record.getMessage()
    assert record.name.startswith("hric")
    assert "link2 breaks the triangle inequality by 0.000230" in text
    assert "link4 breaks the triangle inequality by 0.073013" in text and "eigenvalues -0.0306, -0.0210" in text
    assert "link1" not in text and "link7" not in text


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("arm_id", "7 arms"),
        ("hand", "yes"),
        ("inertials", "mine"),
        ("damping", -1.0),
        ("damping", float("nan")),
        ("friction", "some"),
        ("fingers", "loose"),
        ("xyz", "1 2"),
        ("rpy", "0 0 inf"),
        ("robot_sim_type", "a b"),
        ("hardware_interface", "TorqueInterface"),
    ],
)
def test_a_bad_value_is_refused_with_its_name_and_the_valid_ones(name: str, value: object) -> None:
    with pytest.raises(ParameterError) as error:
        panda_description.load(**{name: value})
    assert f"panda_description.{name} is" in str(error.value)
    assert panda_description.arguments()[name].valid in str(error.value)


def test_an_unknown_argument_is_refused_with_the_valid_names() -> None:
    with pytest.raises(UnknownNameError, match=r"no parameter 'hnad' in panda_description; valid: arm_id, .*hand, "):
        panda_description.load(hnad=True)


def test_moving_fingers_without_a_hand_are_refused() -> None:
    with pytest.raises(ParameterError, match="needs hand:=true"):
        panda_description.load(hand=False, fingers="prismatic")


def test_loading_takes_less_than_a_second_of_computing() -> None:
    panda_description.load()
    begin = time.process_time()
    panda_description.load()
    assert time.process_time() - begin < 1.0


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "hric/descriptions"


def load_in_a_new_process(where: str = "pass") -> tuple[str, bool]:
    """URDF that a new process loads, and True if that process expanded it by xacro."""
    code = f"import sys, panda_description as p; {where}; print(p.load(meshes=False), 'xacro' in sys.modules, sep='#')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    text, expanded = done.stdout.split("#")
    return text, expanded.strip() == "True"


def test_a_description_is_expanded_once_and_by_all_later_processes_read(own_cache: Path) -> None:
    expected = panda_description.load(meshes=False)
    assert load_in_a_new_process() == (expected, True)
    assert load_in_a_new_process() == (expected, False)


def test_a_damaged_cached_description_is_replaced(own_cache: Path) -> None:
    expected, _ = load_in_a_new_process()
    (cached,) = own_cache.iterdir()
    cached.write_text(expected[: len(expected) // 2])
    assert load_in_a_new_process() == (expected, True)
    assert [path.read_text() for path in own_cache.iterdir()] == [expected]


@pytest.mark.parametrize("changed", ["urdf/panda_arm.xacro", "config/joint_limits.yaml"])
def test_a_description_is_expanded_again_after_a_change_of_its_files(
    changed: str, own_cache: Path, tmp_path: Path
) -> None:
    shutil.copytree(parameters.share(), tmp_path / "copy")
    copy = str(tmp_path / "copy")
    moved = f"import pathlib; p.description.share = lambda: pathlib.Path({copy!r})"
    before, _ = load_in_a_new_process(moved)
    path = tmp_path / "copy" / changed
    path.write_text(path.read_text().replace("2.8973", "2.5", 1).replace("0.333", "0.35", 1))
    after, expanded = load_in_a_new_process(moved)
    assert expanded and after != before


def test_a_description_does_not_need_a_cache(own_cache: Path) -> None:
    own_cache.parent.write_text("not a folder")
    assert load_in_a_new_process() == load_in_a_new_process() == (panda_description.load(meshes=False), True)


XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            XACRO.format('<xacro:include filename="a.xacro"/>').encode(),
            "a file includes itself or a macro",
        ),
        (XACRO.format('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>').encode(), ".*a macro calls itself"),
        (XACRO.format('<link name="Prüfling"/>').encode("latin-1"), "'utf-8' codec can't decode"),
        (XACRO.format('<xacro:arg name="q"/>').encode(), "xacro:arg: missing attribute 'default'"),
    ],
)
def test_a_xacro_file_that_cannot_be_expanded_is_one_error(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "a.xacro").write_bytes(content)
    with pytest.raises(DescriptionError, match=f"a.xacro: {message}") as error:
        panda_description.load_file(str(tmp_path / "a.xacro"))
    assert "\n" not in str(error.value)
