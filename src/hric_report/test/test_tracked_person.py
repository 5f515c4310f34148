"""Analysis of a real person after a run: frames of an emulated Motive and external wrench of the robot, compared with
the human in the simulation."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import rosbag
import yaml

from hric_bags.records import human_record
from hric_bags.records.human_record import HumanRecord
from hric_core.command import main
from hric_core.errors import HricError
from hric_human.muscles.after_run import MuscleLoad
from hric_msgs.msg import JointTorque
from hric_report import headless as runner
from hric_report import muscle_load
from hric_report.muscle_load import MuscleLoadError, MuscleLoadResult
from hric_run.definition import experiment, parameters

ENDS = 0.3
"""Duration that is excluded at the begin and at the end of the person's motion [s]."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def written(folder: Path, name: str, source: str) -> Path:
    """Write a run of guided_collection, in which the simulated human is tracked like a real person; noise of markers
    0.5 mm."""
    packaged = experiment.config_path("experiments") / "guided_collection.yaml"
    content = yaml.safe_load(packaged.read_text())
    kept = {key: content[key] for key in content if key not in ("force_plate", "sync")}
    kept["human"]["parts"] = "upper_body"
    kept["mocap"]["stream"]["marker_noise"] = 5e-4
    kept["person"] = {"asset": "body", "calibration": "person.yaml", "force": {"source": source}}
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(kept))
    return path


@pytest.fixture(scope="module")
def run(folder: Path) -> Path:
    overrides = ["simulator:=mujoco", "duration:=3"]
    file = str(written(folder, "seen", "robot"))
    made = runner.run(experiment.load(file, overrides), overrides, root=folder, progress=False, figures=False)
    return made.folder.path


@pytest.fixture(scope="module")
def found(run: Path) -> MuscleLoadResult:
    return muscle_load.of_tracked(str(run))


def truth(run: Path) -> HumanRecord:
    record = muscle_load.described_by(str(run)).record
    assert record is not None
    return record


def off(load: MuscleLoad, record: HumanRecord) -> np.ndarray:
    """Return the difference between estimated and simulated joint torque, shape (n, joints) [N m]."""
    inside = (load.time > ENDS) & (load.time < record.torque_time[-1] - ENDS)
    logged = [
        np.interp(load.time[inside], record.torque_time, record.torque[:, record.joints.index(name)])
        for name in load.joints
    ]
    return np.asarray(load.torque[inside] - np.transpose(logged))


def test_joint_torque_of_who_was_tracked_is_what_moved_them(run: Path, found: MuscleLoadResult) -> None:
    error = off(found.load, truth(run))
    rms = np.sqrt((error**2).mean(axis=0))
    print(f"joint torque, tracked, with the robot's estimate of the force: {rms.max():.3f} N m RMS of the worst joint")
    assert len(error) > 200 and rms.max() < 0.1
    assert found.load.joints[0] == "right_sh_flex" and np.nanmax(found.load.activation) > 0.05
    assert "NOT calibrated" in found.notes[0] and "measured by the robot" in found.notes[1]


def test_without_the_force_on_their_hand_the_torque_would_be_another(
    run: Path, found: MuscleLoadResult, tmp_path: Path
) -> None:
    copy = tmp_path / run.name
    shutil.copytree(run, copy)
    content = yaml.safe_load((copy / "run.yaml").read_text())
    content["definition"]["person"]["force"]["source"] = "none"
    (copy / "run.yaml").write_text(yaml.safe_dump(content))
    alone = muscle_load.of_tracked(str(copy))
    record = truth(run)
    right = [name.startswith("right") for name in alone.load.joints]
    with_force, without = (np.abs(off(one.load, record)[:, right]).max() for one in (found, alone))
    assert without > 5.0 * with_force
    assert "none measured" in alone.notes[1]


def test_the_command_leaves_files_and_a_table(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["muscle_load", str(run), "--tracked"]) == 0
    assert "360 frames" in (printed := capsys.readouterr().out) and "right_delt_scap" in printed
    assert (run / "muscle_load" / "activation.sto").is_file()


def test_what_cannot_be_tracked_is_refused(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["muscle_load", str(run), "--tracked", "--cutoff", "4"]) == 2
    assert "valid: with a run, and without --cutoff" in capsys.readouterr().err
    copy = tmp_path / run.name
    shutil.copytree(run, copy)
    content = yaml.safe_load((copy / "run.yaml").read_text())
    content["definition"]["person"]["asset"] = "somebody"
    (copy / "run.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(HricError, match="360 frames of motion capture, and none of them shows the person"):
        muscle_load.of_tracked(str(copy))
    content["definition"]["person"] = None
    (copy / "run.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(MuscleLoadError, match=r"no person was tracked in .*; valid: a run of an experiment with"):
        muscle_load.of_tracked(str(copy))


def test_the_torque_of_a_real_person_is_none_of_the_simulated_human(run: Path, tmp_path: Path) -> None:
    (bag,) = run.glob("*.bag")
    both = tmp_path / bag.name
    message = JointTorque(name=["right_el_flex"], torque=[1.0], strength_share=[0.1], clipped=[0])
    with rosbag.Bag(str(bag)) as recorded, rosbag.Bag(str(both), "w") as new:
        for topic, raw, when in recorded.read_messages(raw=True):
            new.write(topic, raw, when, raw=True)
        new.write("/hric/person/joint_torque", message)
    first, second = (human_record.read(path, float) for path in (bag, both))
    assert first is not None and second is not None
    assert first.joints == second.joints and np.array_equal(first.torque, second.torque)


def test_the_node_gets_the_section_with_paths_from_the_root(folder: Path) -> None:
    definition = experiment.load(str(written(folder, "node", "plate")), ["person.force.hand:=left"])
    values = parameters.sensors(definition)[parameters.PERSON]
    assert values["calibration"] == str(Path("person.yaml").absolute())
    assert values["force"] == {"source": "plate", "hand": "left"} and values["asset"] == "body"
