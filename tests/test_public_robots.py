"""Every description of PyPI's example-robot-data is read with the result of pinocchio, or refused if invalid."""

import os
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hric_control.transmission import parse_transmissions
from hric_core import plugins, resources, urdf
from hric_core.errors import DescriptionError
from hric_core.resources import read_description

DATA = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
ROBOTS = {str(path.relative_to(DATA)): path for path in sorted(DATA.rglob("*.urdf"))}
REFUSED = {
    "alex_description/urdf/alex_psyonic_hands.urdf": "joint Left_index_q2: it mimics 'index_q1', which is not a joint",
    "ur_description/urdf/ur3.urdf": "the robot description has no <link>; a robot needs at least one",
}
"""Invalid descriptions: one has a joint that mimics a missing joint, the other has no link."""
NO_TRANSMISSIONS = {
    "talos_data/robots/talos_left_arm.urdf": "transmission arm_left_1_trans: no joint 'arm_left_1_joint'",
}
"""Descriptions that contain transmissions of joints that do not exist in them."""
NO_JOINTS = "hector_description/robots/quadrotor_base.urdf", "iris_description/robots/iris_simple.urdf"
"""Descriptions of a single body without joints, which no plant accepts."""
MASSLESS = "romeo.urdf", "romeo_laas_small.urdf"
"""Robots whose fingers have no mass: no engine can simulate them, and their mass matrix is singular."""


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """ROS package with the data, under the package name in the mesh addresses."""
    root = tmp_path_factory.mktemp("ros")
    (root / "example-robot-data").mkdir()
    (root / "example-robot-data/robots").symlink_to(DATA)
    (root / "example-robot-data/package.xml").write_text("<package><name>example-robot-data</name></package>")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_PACKAGE_PATH", f"{root}{os.pathsep}{os.environ['ROS_PACKAGE_PATH']}")
        yield root


def placed(robot: urdf.Robot) -> dict[str, np.ndarray]:
    """Return T_root_link of each link, with all joints at zero."""
    return {robot.root: np.eye(4)} | {joint.child: T for joint, T in robot.beyond(robot.root)}


def test_there_are_the_robots_of_the_package() -> None:
    assert len(ROBOTS) == 69 and set(REFUSED) <= set(ROBOTS)


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in REFUSED])
def test_a_robot_has_the_links_masses_and_joints_that_pinocchio_reads(name: str) -> None:
    robot, model = urdf.read(read_description(ROBOTS[name])), pin.buildModelFromUrdf(str(ROBOTS[name]))
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    moving = [joint.name for joint in robot.joints.values() if joint.type in urdf.ONE_COORDINATE]
    assert sorted(moving) == sorted(model.names[1:])
    for link, T in placed(robot).items():
        frame = model.getFrameId(link, pin.FrameType.BODY)
        assert np.abs(data.oMf[frame].homogeneous - T).max() < 1e-9, link
    groups = robot.rigid_groups()
    mass = sum(link.mass.mass for link in robot.links.values() if link.mass and groups[link.name][0] != robot.root)
    assert mass == pytest.approx(pin.computeTotalMass(model), rel=1e-9)


@pytest.mark.parametrize("name", REFUSED)
def test_a_description_that_cannot_be_meant_is_refused_in_one_sentence_by_both(name: str) -> None:
    with pytest.raises(DescriptionError) as error:
        urdf.read(read_description(ROBOTS[name]))
    assert str(error.value).startswith(REFUSED[name]) and "\n" not in str(error.value)
    with pytest.raises((ValueError, RuntimeError, IndexError)):
        pin.buildModelFromUrdf(str(ROBOTS[name]), mimic=True)


def test_transmissions_are_read_or_left_out_with_one_warning(caplog: pytest.LogCaptureFixture) -> None:
    refusals = {}
    for name in sorted(ROBOTS.keys() - REFUSED.keys()):
        caplog.clear()
        try:
            parse_transmissions(read_description(ROBOTS[name]))
        except DescriptionError as error:
            refusals[name] = str(error).partition(";")[0]
        assert len(caplog.records) <= 1
    assert refusals == NO_TRANSMISSIONS


@pytest.mark.slow
@pytest.mark.parametrize("engine", list(plugins.names(plugins.PLANT)), ids=lambda engine: engine.partition("/")[2])
@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in (*REFUSED, *NO_JOINTS)])
def test_a_robot_loads_on_every_engine(name: str, engine: str, package: Path) -> None:
    assert resources.package_path("example-robot-data") == package / "example-robot-data"
    text = read_description(ROBOTS[name])
    joints = [
        joint for joint in urdf.read(text).joints.values() if joint.type in urdf.ONE_COORDINATE and joint.mimic is None
    ]
    try:
        plant = plugins.find(plugins.PLANT, engine)(text, [joint.name for joint in joints], {})
    except DescriptionError as error:
        assert name.endswith(MASSLESS) and "mass" in str(error)
        return
    try:
        plant.reset([min(max(0.0, joint.lower), joint.upper) for joint in joints])
    finally:
        plant.close()
