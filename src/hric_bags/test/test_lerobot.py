"""Data sets of LeRobot: read by the published layout, and by LeRobot itself where it is installed."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pyarrow.parquet
import pytest
import synthetic
from sensor_msgs.msg import Image, JointState

from franka_msgs.msg import FrankaState
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.robot_time.stamps import to_time

CYCLES, RATE = 1000, 100
LEROBOT = os.environ.get("HRIC_LEROBOT", "")
"""Python interpreter of an environment with LeRobot, whose pinned dependencies differ from those of the workspace."""
READ = """
import sys, numpy
from lerobot.datasets.lerobot_dataset import LeRobotDataset
data = LeRobotDataset("local/run", root=sys.argv[1])
assert data.fps == 100 and data.num_episodes == 2, (data.fps, data.num_episodes)
rows = [data[k] for k in range(len(data))]
names = [name for name in data.features if name not in ("task",)]
columns = {name: numpy.stack([row[name] for row in rows]) for name in names}
numpy.savez(sys.argv[2], tasks=[row["task"] for row in rows], **columns)
"""


def states(k: int) -> JointState:
    message = JointState(name=["right_el_flex", "right_wr_flex"], position=[0.01 * k, -0.02 * k])
    message.header.stamp = to_time(k * 0.005)
    return message


def wrench(k: int) -> FrankaState:
    message = FrankaState(O_F_ext_hat_K=[1.0 * k, 2.0, 3.0, 4.0, 5.0, 6.0])
    message.header.stamp = to_time(k * 0.02)
    return message


def made(root: Path, person: bool = True, **settings: Any) -> RunFolder:
    extra = [("/franka_state_controller/franka_states", wrench(k), 0.02 * k) for k in range(50)]
    if person:
        extra += [("/hric/human/joint_states", states(k), 0.005 * k) for k in range(200)]
    return synthetic.write_run(root, CYCLES, extra=extra, **settings)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("runs")
    first, second = made(root / "a"), made(root / "b", sent_at=0.2)
    assert (
        main(["export", str(first.path), str(second.path), "--format", "lerobot", "--output", str(root / "out")]) == 0
    )
    return root / "out" / "lerobot"


def frames(dataset: Path) -> dict[str, Any]:
    info = json.loads((dataset / "meta/info.json").read_text())
    path = info["data_path"].format(chunk_index=0, file_index=0)
    table = pyarrow.parquet.read_table(dataset / path)
    return {name: np.array(table[name].to_pylist()) for name in table.column_names}


def test_each_frame_has_the_values_of_its_control_cycle(dataset: Path) -> None:
    data, length = frames(dataset), len(frames(dataset)["index"]) // 2
    assert length == 99  # until the last state of the arm, at 0.98 s
    for episode, sent_at in enumerate((0.1, 0.2)):
        rows = slice(episode * length, (episode + 1) * length)
        _, position, velocity = (
            values[::10][:length].astype(np.float32) for values in synthetic.signals(CYCLES, sent_at)
        )
        assert np.array_equal(data["observation.state"][rows], position)
        assert np.array_equal(data["observation.velocity"][rows], velocity)
        np.testing.assert_allclose(data["action"][rows], 10 * position, rtol=1e-6)
        np.testing.assert_array_equal(data["observation.effort"][rows], data["action"][rows])


def test_each_of_two_arms_has_its_wrench(tmp_path: Path) -> None:
    extra = [(f"/{arm}/franka_state_controller/franka_states", wrench(k), 0.02 * k) for arm in "ab" for k in range(50)]
    for _, message, _ in extra[50:]:
        message.O_F_ext_hat_K[1] = -2.0
    run = synthetic.write_run(tmp_path, CYCLES, extra=extra)
    assert main(["export", str(run.path), "--format", "lerobot", "--output", str(tmp_path / "out")]) == 0
    data = frames(tmp_path / "out" / "lerobot")
    assert [float(data[f"observation.wrench.{arm}"][5, 1]) for arm in "ab"] == [2.0, -2.0]


def test_signals_of_the_person_and_the_wrench_are_on_the_same_grid(dataset: Path) -> None:
    data = frames(dataset)
    k = data["frame_index"]
    np.testing.assert_allclose(data["observation.human"], np.column_stack([0.02 * k, -0.04 * k]), atol=1e-6)
    np.testing.assert_array_equal(data["observation.wrench"][:, 0], k // 2)  # of a sample at or before the frame
    assert (data["observation.wrench"][:, 1:] == [2, 3, 4, 5, 6]).all()
    notes = json.loads((dataset / "meta/info.json").read_text())["notes"]
    assert "/hric/human/joint_states as recorded" in notes
    assert any("the newest sample at or before each frame, at most 0.01 s old" in note for note in notes)


def test_no_frame_before_a_step_shows_it(tmp_path: Path) -> None:
    """Wrench and person jump at 0.5 s; they are sampled at 50 Hz and 40 Hz, and the frames at 100 Hz."""
    arms, people = [wrench(k) for k in range(50)], [states(5 * k) for k in range(40)]
    for k, message in enumerate(arms):
        message.O_F_ext_hat_K = [100.0 * (k >= 25)] * 6
    for k, message in enumerate(people):
        message.position = [1.0 * (k >= 20), 0.0]
    extra = [("/franka_state_controller/franka_states", message, 0.02 * k) for k, message in enumerate(arms)]
    extra += [("/hric/human/joint_states", message, 0.025 * k) for k, message in enumerate(people)]
    run = synthetic.write_run(tmp_path, CYCLES, extra=extra)
    assert main(["export", str(run.path), "--format", "lerobot", "--output", str(tmp_path / "out")]) == 0
    data = frames(tmp_path / "out" / "lerobot")
    k = data["frame_index"]
    np.testing.assert_array_equal(data["observation.wrench"], np.column_stack([100.0 * (k >= 50)] * 6))
    np.testing.assert_array_equal(data["observation.human"][:, 0], k >= 50)


@pytest.mark.parametrize("lost", [range(60, 120), range(100)], ids=["within", "first"])
@pytest.mark.parametrize("topic", ["/hric/human/joint_states", "/franka_state_controller/franka_states"])
def test_values_that_are_not_known_are_refused_before_a_file_is_written(
    topic: str, lost: range, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    people, arms = [states(k) for k in range(200)], [wrench(k) for k in range(50)]
    for k in lost:
        people[k].position = [0.01 * k, np.nan]
        arms[k // 4].O_F_ext_hat_K = [np.nan] * 6
    messages, period = (people, 0.005) if topic.endswith("joint_states") else (arms, 0.02)
    run = synthetic.write_run(tmp_path, CYCLES, extra=[(topic, one, period * k) for k, one in enumerate(messages)])
    assert main(["export", str(run.path), "--format", "lerobot", "--output", str(tmp_path / "out")]) == 1
    assert f"is not known (NaN) at {0.005 * lost[0]:.3f} s" in capsys.readouterr().err
    assert not list((tmp_path / "out").rglob("*.parquet"))


def test_numbers_and_times_of_frames_are_those_that_lerobot_demands(dataset: Path) -> None:
    data = frames(dataset)
    assert data["index"].tolist() == list(range(198)) and data["frame_index"].tolist() == 2 * list(range(99))
    assert data["episode_index"].tolist() == [0] * 99 + [1] * 99
    np.testing.assert_allclose(data["timestamp"], data["frame_index"] / RATE, atol=1e-6)


def test_episodes_tasks_and_statistics_describe_the_frames(dataset: Path) -> None:
    data = frames(dataset)
    info = json.loads((dataset / "meta/info.json").read_text())
    episodes = pandas.read_parquet(dataset / "meta/episodes/chunk-000/file-000.parquet")
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 198, 1)
    assert episodes["dataset_from_index"].tolist() == [0, 99] and episodes["dataset_to_index"].tolist() == [99, 198]
    tasks = pandas.read_parquet(dataset / "meta/tasks.parquet")
    assert tasks.index.tolist() == ["made up"] and tasks["task_index"].tolist() == [0]
    statistics = json.loads((dataset / "meta/stats.json").read_text())
    for name, values in data.items():
        rows = values.reshape(len(values), -1)
        np.testing.assert_allclose(statistics[name]["mean"], rows.mean(0), rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(statistics[name]["q90"], np.quantile(rows, 0.9, axis=0), rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(episodes[f"stats/{name}/max"][1], rows[99:].max(0), rtol=1e-6)
        assert info["features"][name]["shape"] == list(rows.shape[1:])
    assert info["features"]["observation.wrench"]["units"] == ["N", "N", "N", "N m", "N m", "N m"]


@pytest.mark.skipif(
    not LEROBOT, reason="HRIC_LEROBOT does not name the Python interpreter of an environment with LeRobot"
)
def test_lerobot_reads_every_value(dataset: Path, tmp_path: Path) -> None:
    environment = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path), "PATH": os.environ["PATH"]}
    subprocess.run([LEROBOT, "-c", READ, dataset, tmp_path / "read.npz"], check=True, env=environment)
    ours = frames(dataset)
    with np.load(tmp_path / "read.npz") as theirs:
        assert set(theirs["tasks"]) == {"made up"}
        assert {name: np.array_equal(theirs[name], ours[name]) for name in ours} == dict.fromkeys(ours, True)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--format", "lerobot", "--rate", "70"], "--rate 70: valid: 1000 Hz of the control log over a whole number"),
        (["--format", "lerobot", "--rate", "0"], "--rate"),
        (["--format", "csv", "--rate", "50"], "--rate has no effect"),
    ],
)
def test_a_rate_that_is_not_possible_is_one_sentence(
    tmp_path: Path, arguments: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(made(tmp_path).path), *arguments]) in (1, 2)
    message = capsys.readouterr().err
    assert reason in message and message.count("\n") == 1


def test_runs_with_different_signals_are_no_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with_person, alone = made(tmp_path / "a"), made(tmp_path / "b", person=False)
    assert main(["export", str(with_person.path), str(alone.path), "--format", "lerobot"]) == 1
    assert "run 2 differs from the first one in observation.human; valid: " in capsys.readouterr().err


def test_several_runs_are_refused_for_other_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = str(made(tmp_path).path)
    assert main(["export", run, run, "--format", "lerobot", "csv"]) == 2
    assert "several runs are given; valid: only --format lerobot" in capsys.readouterr().err


def test_pictures_are_left_out_with_a_word(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = synthetic.write_run(tmp_path, CYCLES, extra=[("/camera/image_raw", Image(), 0.1)])
    assert main(["export", str(run.path), "--format", "lerobot"]) == 0
    assert "lerobot: pictures of /camera/image_raw are left out" in capsys.readouterr().out


def commanded(root: Path, kinds: str) -> RunFolder:
    """Write a run with a type of command for each batch of 20 cycles: n none, e effort, p position."""
    names, data = {"n": "none", "e": "effort", "p": "position"}, synthetic.signals(20 * len(kinds), 0.1)
    folder = RunFolder.create(root, "made_up")
    with synthetic.BagWriter(folder.bag_path) as bag:
        for batch, kind in enumerate(kinds):
            message = synthetic.log_message(20 * batch, 20, data)
            message.command_interface = [names[kind]] * 3
            if kind == "n":
                message.command = message.command_raw = [0.0] * 60
            bag.write("/control_log", message, 0.02 * (batch + 1))
    folder.write({"experiment": "made_up", "status": "completed", "mode": "headless", "bag": folder.bag_path.name})
    return folder


@pytest.mark.parametrize(
    ("kinds", "span", "least"), [("nppppn", (0.02, 0.1), 1e-3), ("nnnnnn", None, 0.0), ("eeennn", (0.0, 0.12), 0.0)]
)
def test_cycles_without_a_command_are_no_actions(
    tmp_path: Path, kinds: str, span: tuple[float, float] | None, least: float
) -> None:
    run = commanded(tmp_path, kinds)
    assert main(["export", str(run.path), "--format", "lerobot", "--output", str(tmp_path / "out")]) == 0
    data = frames(tmp_path / "out" / "lerobot")
    notes = json.loads((tmp_path / "out/lerobot/meta/info.json").read_text())["notes"]
    assert ("action" in data) is (span is not None) is ("no action" not in str(notes))
    begin, end = span or (0.0, 0.12)
    assert len(data["index"]) == round(100 * (end - begin))
    if span:
        np.testing.assert_allclose(data["observation.state"][0], synthetic.signals(120, 0.1)[1][round(1e3 * begin)])
        assert np.abs(data["action"][:, 1]).min() >= least


@pytest.mark.parametrize(("kinds", "message"), [("ppnnpp", "of action is not known (NaN) at 0.040 s")])
def test_a_time_without_commands_between_others_is_refused(
    tmp_path: Path, kinds: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run = commanded(tmp_path, kinds)
    assert main(["export", str(run.path), "--format", "lerobot", "--output", str(tmp_path / "out")]) == 1
    assert message in capsys.readouterr().err


def test_a_command_that_changes_its_unit_has_none(tmp_path: Path) -> None:
    run = commanded(tmp_path, "eeeppp")
    assert main(["export", str(run.path), "--format", "csv", "--output", str(tmp_path / "out")]) == 0
    text = (tmp_path / "out/csv/control_log.csv").read_text()
    assert "# unit of command.j1: none or not known" in text and "the unit changes during the run: command" in text


def test_lost_cycles_are_noted_in_the_data_set(tmp_path: Path) -> None:
    run = made(tmp_path, lost=(20, 21)).path
    assert main(["export", str(run), "--format", "lerobot"]) == 0
    notes = json.loads((run / "export/lerobot/meta/info.json").read_text())["notes"]
    assert "40 cycles are missing from cycle 400 on" in notes


def test_a_person_recorded_after_the_arm_has_no_frame(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    late = [("/hric/human/joint_states", states(k), 0.005 * k) for k in range(900, 1100)]
    run = synthetic.write_run(tmp_path, CYCLES, extra=late)
    assert main(["export", str(run.path), "--format", "lerobot"]) == 1
    assert "s in common; valid: at least two frames" in capsys.readouterr().err
