"""The template of a new robot with the descriptions of a KUKA iiwa and a Kinova, as the page "a new robot" says."""

import os
import re
import shutil
import sysconfig
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from hric_assessment.contact.mass import moving_masses
from hric_core import urdf
from hric_core.errors import HricError
from hric_run.simulation import Simulation

TEMPLATE = Path(__file__).resolve().parents[1] / "src/hric_experiments/templates/my_robot"
DATA = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data"
IIWA = [f"lbr_iiwa_joint_{number}" for number in range(1, 8)]
KINOVA = [f"j2s6s200_joint_{number}" for number in range(1, 7)]
TOOL = 0.5
"""Mass of the template's tool [kg]."""


def robot(folder: Path, source: Path, joints: list[str], root: str, flange: str) -> Path:
    """Return the template in a folder, with the names of a robot in its lines; source: description of the robot."""
    shutil.copytree(TEMPLATE, folder, dirs_exist_ok=True)
    shutil.copy(source, folder / "robot.urdf")
    path = folder / "my_robot.urdf.xacro"
    text = path.read_text().replace("'joint_1', 'joint_2', 'joint_3'", str(joints)[1:-1])
    text = text.replace("[0.1, 0.1, 0.1]", f"[0.1] * {len(joints)}").replace('"base_link"', f'"{root}"')
    path.write_text(text.replace('"tool0"', f'"{flange}"'))
    return path


@pytest.fixture(scope="module")
def iiwa(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, data = tmp_path_factory.mktemp("iiwa"), Path(pybullet_data.getDataPath()) / "kuka_iiwa"
    shutil.copytree(data / "meshes", folder / "meshes")
    return robot(folder, data / "model.urdf", IIWA, "lbr_iiwa_link_0", "lbr_iiwa_link_7")


@pytest.fixture(scope="module")
def kinova(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Kinova, without the transmissions of its description, some of which are of fixed joints."""
    folder = tmp_path_factory.mktemp("kinova")
    source = DATA / "robots/kinova_description/robots/kinova.urdf"
    path = robot(folder, source, KINOVA, "base", "j2s6s200_end_effector")
    own = folder / "robot.urdf"
    own.write_text(re.sub(r"<transmission.*?</transmission>", "", own.read_text(), flags=re.DOTALL))
    package = folder / "ros/example-robot-data"
    package.mkdir(parents=True)
    (package / "robots").symlink_to(DATA / "robots")
    (package / "package.xml").write_text("<package><name>example-robot-data</name></package>")
    return path


def simulation(path: Path, start: list[float], goal: list[float], **changes: object) -> Simulation:
    setpoint = {"time": 0.1, "controller": "joint_pd_controller", "positions": goal}
    own = {"robot.urdf": str(path), "q_start": start, "setpoints": [setpoint], "duration": 4.0}
    return Simulation(str(path.parent / "my_robot.yaml"), **(own | changes))


@pytest.mark.parametrize("simulator", ["pybullet", "mujoco"])
def test_an_iiwa_reaches_its_setpoint(iiwa: Path, simulator: str) -> None:
    start, goal = [0.0, 0.3, 0.0, -1.5, 0.0, 1.2, 0.0], [0.5, 0.5, 0.0, -1.3, 0.0, 1.2, 0.4]
    with simulation(iiwa, start, goal, simulator=simulator) as run:
        run.run()
        np.testing.assert_allclose(run.signals.position[-1], goal, atol=1e-3)
        tree = urdf.read(run.tree["robot_description"])
    assert moving_masses(tree, IIWA)[1] == TOOL


@pytest.mark.parametrize("simulator", ["pybullet", "mujoco", "opensim"])
def test_a_kinova_reaches_its_setpoint(kinova: Path, simulator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{kinova.parent / 'ros'}{os.pathsep}{os.environ['ROS_PACKAGE_PATH']}")
    start, goal = [0.0, 3.0, 2.0, 0.0, 1.0, 0.0], [0.3, 3.2, 1.8, 0.2, 1.2, 0.3]
    with simulation(kinova, start, goal, simulator=simulator) as run:
        run.run()
        np.testing.assert_allclose(run.signals.position[-1], goal, atol=1e-3)


def test_the_distance_from_a_robot_of_meshes_is_not_known(iiwa: Path) -> None:
    with (
        simulation(iiwa, [0.0] * 7, [0.1] * 7, simulator="mujoco") as run,
        pytest.raises(HricError, match="<mesh> has no capsule: lbr_iiwa_link_1"),
    ):
        run.observe()


def test_the_template_without_names_of_a_robot_is_refused() -> None:
    with (
        pytest.raises(HricError, match=r"robot\.urdf"),
        Simulation(str(TEMPLATE / "my_robot.yaml"), **{"robot.urdf": str(TEMPLATE / "my_robot.urdf.xacro")}),
    ):
        pass
