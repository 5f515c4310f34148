"""Experiments with a UR5e from the run to the verdict: contact, hand guidance and shared workspace."""

import json
from pathlib import Path

import numpy as np
import pytest

from hric_assessment.findings import CONTACT, SEPARATION, Finding, Outcome
from hric_assessment.separation.stopping import StopTable
from hric_assessment.verdict.assess import assess
from hric_assessment.verdict.choices import AssessmentChoices, BrakingChoice
from hric_assessment.verdict.inputs import opened
from hric_bags.run_folder import RunFolder
from hric_core import urdf
from hric_core.command import main
from hric_core.errors import HricError
from hric_run.definition import experiment
from hric_run.simulation import Simulation

STOPS = {
    "title": "stops of the test",
    "kind": "measurement",
    "source": "made up",
    "reaction_time": 0.05,
    "stops": [{"speed": 3.0, "load": 5.0, "time": 0.1}],
}


def run(name: str, root: Path, *changes: str) -> RunFolder:
    """Return the folder of a run on MuJoCo."""
    assert main(["run", name, "simulator:=mujoco", *changes, "--runs", str(root), "--quiet", "--no-figures"]) == 0
    return RunFolder.open("latest", root)


def findings(folder: RunFolder, group: str, choices: AssessmentChoices | None = None) -> list[Finding]:
    verdict = assess(opened(str(folder.path)), choices, muscles=False)
    return [finding for finding in verdict.findings if finding.group == group]


@pytest.fixture(scope="module")
def contact(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    return run("ur5e_contact", tmp_path_factory.mktemp("contact"), "duration:=2.0")


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    setpoint = "[{time: 0.0, controller: joint_pd_controller, positions: [3.6, -1.2, 1.5, -1.9, -pi/2, 0]}]"
    return run("ur5e_shared_workspace", tmp_path_factory.mktemp("shared"), "duration:=3.0", f"setpoints:={setpoint}")


def test_a_contact_has_the_force_of_the_closed_form(contact: RunFolder) -> None:
    first = json.loads(contact.metrics_path.read_text())["human"]["contacts"][0]
    assert first["transient"]["ratio"] == pytest.approx(1.0, abs=0.02)


def test_a_contact_is_judged_by_the_mass_of_this_robot(contact: RunFolder) -> None:
    first = json.loads(contact.metrics_path.read_text())["human"]["contacts"][0]
    (finding,) = findings(contact, CONTACT)
    assert finding.outcome == Outcome.WITHIN and finding.values["M/2 + m_L [kg]"] == pytest.approx(17.7 / 2)
    assert finding.values["reflected mass of the robot m_u [kg]"] == pytest.approx(
        first["transient"]["robot_mass"], rel=1e-3
    )


def test_a_distance_is_not_proven_without_the_stopping_of_this_robot(shared: RunFolder) -> None:
    (finding,) = findings(shared, SEPARATION)
    assert finding.outcome == Outcome.NOT_ASSESSABLE
    assert "how fast ur5e stops is not known" in finding.reason and "--stop FILE" in finding.remedy


@pytest.mark.parametrize(
    ("robot", "outcome"),
    [("ur5e", Outcome.WITHIN), ("ur10e", Outcome.NOT_ASSESSABLE), (None, Outcome.NOT_ASSESSABLE)],
)
def test_a_distance_is_proven_by_stops_of_this_robot_only(
    shared: RunFolder, robot: str | None, outcome: Outcome
) -> None:
    choices = AssessmentChoices(braking=BrakingChoice(StopTable.of(STOPS | {"robot": robot}, "stops:")))
    (finding,) = findings(shared, SEPARATION, choices)
    assert finding.outcome == outcome


def test_the_supervisor_stops_it_before_a_person(shared: RunFolder) -> None:
    supervised = json.loads(shared.metrics_path.read_text())["supervisor"]
    assert supervised["share_stopped"] > 0.1 and supervised["violations"] == []


def changed(name: str, **keys: object) -> experiment.Experiment:
    """Return an experiment with other values of these keys."""
    return experiment.parse(name, experiment.read(name) | keys)


def tool(simulation: Simulation, description: urdf.Robot) -> np.ndarray:
    """Return the pose of the flange at the end of the run so far, shape (4, 4)."""
    signals = simulation.signals
    return description.poses(dict(zip(signals.joint_names, signals.position[-1], strict=True)))["tool0"]


def test_its_cartesian_impedance_is_a_spring_with_the_stiffness_of_the_file() -> None:
    force, stiffness = np.array([3.0, -4.0, 5.0]), 100.0
    with Simulation(changed("ur5e_hand_guidance", human=None, duration=10.0)) as simulation:
        description = urdf.read(simulation.tree["robot_description"])
        simulation.run(1.0)
        before = tool(simulation, description)
        simulation.app.hw.plant.apply_wrench("wrist_3_link", force.tolist(), [0.0] * 3, [0.0] * 3, -1.0)
        simulation.run(9.0)
        after = tool(simulation, description)
    np.testing.assert_allclose(after[:3, 3] - before[:3, 3], force / stiffness, atol=1e-4)
    np.testing.assert_allclose(after[:3, :3], before[:3, :3], atol=1e-3)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"end_effector": ""}, "joints of another arm: only if end_effector is set"),
        ({"end_effector": "gripper"}, "end_effector: .*gripper"),
        (
            {"joint_names": ["elbow_joint", "wrist_1_joint"]},
            "tool0 is moved by shoulder_pan_joint, .*; valid: a link moved by elbow_joint, wrist_1_joint,",
        ),
    ],
)
def test_a_wrong_end_effector_is_refused(parameters: dict[str, object], message: str) -> None:
    raw = experiment.read("ur5e_hand_guidance")["parameters"]["cartesian_impedance_controller"]
    own = {"cartesian_impedance_controller": raw | parameters}
    with pytest.raises(HricError, match=message), Simulation(changed("ur5e_hand_guidance", human=None, parameters=own)):
        pass


def test_a_person_leads_it_by_a_grip_that_holds(tmp_path: Path) -> None:
    metrics = json.loads(run("ur5e_hand_guidance", tmp_path).metrics_path.read_text())["human"]
    (grip,) = metrics["grips"].values()
    assert grip["slips"] == 0 and 5.0 < grip["force_max"] < 15.0


def test_what_only_a_franka_has_is_refused_by_its_name() -> None:
    with (
        pytest.raises(HricError, match=r"robot\.load is a payload in the control box of a Franka arm"),
        Simulation("ur5e_step", **{"robot.load.mass": 1.0}),
    ):
        pass
    with (
        pytest.raises(HricError, match="FrankaPoseCartesianInterface"),
        Simulation(changed("ur5e_step", controllers=["cartesian_pose_controller"], parameters={}, setpoints=[])),
    ):
        pass
