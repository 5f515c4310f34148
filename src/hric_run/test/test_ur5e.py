"""A robot other than Franka's, the UR5e: its description, its controllers, and a contact with a person."""

import math
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from hric_assessment.contact.mass import Mechanism
from hric_core import urdf
from hric_core.errors import HricError
from hric_run.definition import experiment, parameters, robot_description
from hric_run.simulation import Simulation

DH = (
    (0.1625, 0.0, math.pi / 2),
    (0.0, -0.425, 0.0),
    (0.0, -0.3922, 0.0),
    (0.1333, 0.0, math.pi / 2),
    (0.0997, 0.0, -math.pi / 2),
    (0.0996, 0.0, 0.0),
)
"""d [m], a [m], alpha [rad] of each joint: Universal Robots, DH parameters of the UR5e."""
MASSES = (3.761, 8.058, 2.846, 1.37, 1.3, 0.365)
"""Masses of the links that the joints move [kg], same source."""
JOINTS = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
Q = np.array([0.3, -1.0, 1.2, -0.7, 0.4, 0.9])
STEP = "ur5e_step"


@pytest.fixture(scope="module")
def description() -> str:
    return robot_description.description(experiment.load(STEP).robot)


def transform(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """Return T = Rz(theta) Tz(d) Tx(a) Rx(alpha), the transform of a joint by Denavit and Hartenberg."""
    c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


def test_the_tool_is_where_the_published_parameters_place_it(description: str) -> None:
    T = urdf.read(description).poses(dict(zip(JOINTS, Q, strict=True)))["tool0"]
    expected = np.eye(4)
    for theta, row in zip(Q, DH, strict=True):
        expected = expected @ transform(theta, *row)
    np.testing.assert_allclose(T, expected, atol=1e-12)


def test_the_moving_links_have_the_published_masses(description: str) -> None:
    tree = urdf.read(description)
    bodies = [tree.links[tree.joints[name].child].mass for name in JOINTS]
    assert [body.mass for body in bodies if body is not None] == list(MASSES)


@pytest.mark.parametrize("link", ["forearm_link", "wrist_3_link"])
def test_the_reflected_mass_is_that_of_an_independent_library(description: str, link: str) -> None:
    rotors, normal, point = [0.1, 0.2, 0.3, 0.04, 0.05, 0.06], np.array([0.6, 0.0, 0.8]), np.array([-0.4, -0.3, 0.5])
    model = pinocchio.buildModelFromXML(description)
    data, frame = model.createData(), model.getFrameId(link)
    M = np.triu(pinocchio.crba(model, data, Q))
    M = M + np.triu(M, 1).T + np.diag(rotors)
    J = pinocchio.computeFrameJacobian(model, data, Q, frame, pinocchio.LOCAL_WORLD_ALIGNED)
    pinocchio.framesForwardKinematics(model, data, Q)
    row = normal @ (J[:3] - pinocchio.skew(point - data.oMf[frame].translation) @ J[3:])
    mass = Mechanism(urdf.read(description), JOINTS, rotors).reflected_mass(Q, link, point.tolist(), normal.tolist())
    assert mass == pytest.approx(1.0 / (row @ np.linalg.solve(M, row)), rel=1e-9)


@pytest.mark.parametrize("simulator", ["pybullet", "mujoco", "opensim"])
def test_it_reaches_its_setpoint_in_every_engine(simulator: str) -> None:
    with Simulation(STEP, simulator=simulator) as simulation:
        simulation.run()
        np.testing.assert_allclose(
            simulation.signals.position[-1], simulation.definition.setpoints[0].positions, atol=1e-6
        )


def test_default_controllers_get_the_joints_of_the_robot() -> None:
    names = ["joint_streaming_controller", "position_joint_trajectory_controller"]
    raw = experiment.read(STEP) | {"controllers": names, "parameters": {}, "setpoints": []}
    for values in parameters.controllers(experiment.parse("own", raw)).values():
        assert values["joints"] == JOINTS and "panda" not in str(values)


def test_gains_that_belong_to_a_franka_arm_are_not_used_for_another_robot() -> None:
    raw = experiment.read(STEP) | {"controllers": ["effort_joint_trajectory_controller"]}
    with (
        pytest.raises(HricError, match="gains has no value for shoulder_pan_joint"),
        Simulation(experiment.parse("own", raw | {"parameters": {}, "setpoints": []})),
    ):
        pass


def test_a_franka_in_a_file_of_its_own_keeps_its_gains(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(robot_description.description(experiment.load("pd_step").robot))
    raw = experiment.read("pd_step")
    raw |= {"robot": {"hw": "hric_control/RobotHWSim", "urdf": str(path)}}
    arm = experiment.parse(
        "own", raw | {"controllers": ["effort_joint_trajectory_controller"], "parameters": {}, "setpoints": []}
    )
    (values,) = parameters.controllers(arm).values()
    assert "panda_joint1" in values["gains"]  # type: ignore[operator]
