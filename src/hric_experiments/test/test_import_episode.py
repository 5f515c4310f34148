"""Import of an episode of a LeRobot data set as an experiment, and its replay through the emulated control box."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
import yaml

from hric_bags import reader
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_run.definition import experiment

FPS, FRAMES = 50, 151
READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
JOINTS = [f"panda_joint{k}" for k in range(1, 8)]
STATE = {"dtype": "float32", "shape": [7], "names": JOINTS}


WORLD = """
objects:
  - {name: block, shape: box, size: [0.2, 0.2, 0.6], pose: {xyz: [0.35, 0.27, 0.5]}}
"""


def motion(amplitude: float) -> np.ndarray:
    """Return joint positions that leave READY and come back, shape (FRAMES, 7) [rad]."""
    phase = 2 * np.pi * np.arange(FRAMES) / (FRAMES - 1)
    return READY + amplitude * (1.0 - np.cos(phase))[:, None] * np.array([1, 0.5, -0.5, 1, 0.5, -1, 1]) / 2


def version_3(folder: Path, values: np.ndarray, names: list[str] | None, width: int = 7) -> Path:
    """Write a data set of two episodes in the layout of version 3; the second has these values."""
    still = np.tile(values[0], (10, 1))
    rows = np.concatenate([still, values]).astype(np.float32)
    episodes = [0] * len(still) + [1] * len(values)
    write(folder, "v3.0", "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", names, width)
    table(folder / "data/chunk-000/file-001.parquet", rows, episodes)
    (folder / "meta/episodes/chunk-000").mkdir(parents=True)
    about = {"episode_index": [0, 1], "data/chunk_index": [0, 0], "data/file_index": [1, 1]}
    pandas.DataFrame(about).to_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    pandas.DataFrame({"task_index": [0, 1]}, index=["none", "wave"]).to_parquet(folder / "meta/tasks.parquet")
    return folder


def version_2(folder: Path, values: np.ndarray, names: list[str] | None, width: int = 7) -> Path:
    """Write a data set in the layout of version 2, with a file per episode."""
    pattern = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    write(folder, "v2.1", pattern, names, width)
    table(folder / "data/chunk-000/episode_000001.parquet", values.astype(np.float32), [1] * len(values))
    (folder / "meta/tasks.jsonl").write_text('{"task_index": 0, "task": "none"}\n{"task_index": 1, "task": "wave"}\n')
    return folder


def write(folder: Path, version: str, pattern: str, names: list[str] | None, width: int) -> None:
    (folder / "meta").mkdir(parents=True)
    feature = {"dtype": "float32", "shape": [width], "names": names}
    info = {"codebase_version": version, "robot_type": "panda", "total_episodes": 2, "chunks_size": 1000, "fps": FPS}
    info |= {
        "data_path": pattern,
        "features": {"observation.state": feature, "index": {"dtype": "int64", "shape": [1]}},
    }
    (folder / "meta/info.json").write_text(json.dumps(info))


def table(path: Path, rows: np.ndarray, episodes: list[int]) -> None:
    """Write frames in random order, with the columns that data sets of LeRobot and of Isaac GR00T share."""
    path.parent.mkdir(parents=True)
    columns = {
        "observation.state": list(rows),
        "index": range(len(rows)),
        "episode_index": episodes,
        "task_index": episodes,
    }
    pandas.DataFrame(columns).sample(frac=1.0, random_state=0).to_parquet(path)


def imported(dataset: Path, *options: str) -> Path:
    path = dataset.parent / "wave.yaml"
    assert main(["import", str(dataset), "--episode", "1", "-o", str(path), *options]) == 0
    return path


@pytest.mark.parametrize("make", [version_2, version_3])
@pytest.mark.parametrize("names", [JOINTS, [f"joint_{k}.pos" for k in range(7)]])
def test_positions_and_task_of_an_episode_are_read(tmp_path: Path, make: Any, names: list[str]) -> None:
    values = motion(0.4)
    path = imported(make(tmp_path / "data", values, names))
    rows = np.loadtxt(path.with_suffix(".csv"), delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 0], np.arange(FRAMES) / FPS, atol=1e-9)
    np.testing.assert_allclose(rows[:, 1:], values, atol=1e-6)
    made = experiment.load(str(path))
    assert made.description == "episode 1 of data: wave"
    np.testing.assert_allclose(made.robot.q_start, values[0], atol=1e-6)


def test_signals_are_chosen_by_name_or_index(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = np.column_stack([motion(0.4)[:, ::-1], np.full(FRAMES, 0.04)])
    dataset = version_3(tmp_path / "data", values, None, width=8)
    rows = np.loadtxt(imported(dataset, "--signals", *"6543210").with_suffix(".csv"), delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 1:], motion(0.4), atol=1e-6)
    assert main(["import", str(dataset), "-o", str(tmp_path / "twice.yaml"), "--signals", *"6543211"]) == 2
    assert "--signals names a signal twice: 6, 5, 4, 3, 2, 1, 1; valid: 7" in capsys.readouterr().err


def replayed(path: Path, runs: Path, *changes: str) -> tuple[Any, str]:
    main(["run", str(path), *changes, "--runs", str(runs), "--no-figures", "--quiet"])
    folder = RunFolder.open("latest", runs)
    return reader.read(folder.bag_of(folder.read())), (folder.path / "summary.txt").read_text()


def test_the_arm_moves_as_in_the_episode(tmp_path: Path) -> None:
    values = motion(0.4)
    record, summary = replayed(imported(version_3(tmp_path / "data", values, JOINTS)), tmp_path / "runs")
    begin = 500 + 1  # sent at 0.5 s, followed from the next cycle on
    positions = record.log.position[begin : begin + 20 * FRAMES : 20][:FRAMES]
    assert record.reflexes == [] and "PROTECTED ITSELF" not in summary
    assert np.abs(positions - values).max() < 0.02
    assert np.ptp(positions, axis=0).min() > 0.19


def test_an_arm_that_hits_something_names_the_reflex(tmp_path: Path) -> None:
    path = imported(version_3(tmp_path / "data", motion(0.4), JOINTS))
    (tmp_path / "world.yaml").write_text(WORLD)
    record, summary = replayed(path, tmp_path / "runs", f"world:={tmp_path / 'world.yaml'}")
    time, names = record.reflexes[0]
    assert 0.5 < time < 2.5 and any("reflex" in name for name in names)
    assert f"THE ARM PROTECTED ITSELF at {time:.3f} s: {', '.join(names)}" in summary


def test_a_motion_that_is_too_fast_is_limited_and_the_report_says_so(tmp_path: Path) -> None:
    path = imported(version_3(tmp_path / "data", motion(0.4), JOINTS))
    rows = np.loadtxt(path.with_suffix(".csv"), delimiter=",", skiprows=1)
    rows[:, 0] /= 20.0
    np.savetxt(path.with_suffix(".csv"), rows, delimiter=",", header=",".join(["time", *JOINTS]), comments="")
    record, summary = replayed(path, tmp_path / "runs")
    assert record.limit_counts.velocity[0] > 0 and "limits acted" in summary


def test_a_jolt_that_the_box_smooths_is_reported(tmp_path: Path) -> None:
    values = motion(0.4)
    values[75, 4] += 0.02
    record, summary = replayed(imported(version_3(tmp_path / "data", values, JOINTS)), tmp_path / "runs")
    change = np.abs(record.log.command - record.log.command_raw).max(axis=0)
    assert change[4] > 0.01 and not any(record.limit_counts.velocity)
    assert f"by up to: panda_joint5 {change[4]:.2g}\n" in summary and "no limit acted" not in summary


@pytest.mark.parametrize(
    ("values", "names", "options", "reason"),
    [
        (np.degrees(motion(0.4)), JOINTS, [], "observation.state reaches 135; valid: joint positions in rad"),
        (
            motion(0.4),
            ["x", "y", "z", "a", "b", "c", "grip"],
            [],
            "do not show the 7 joints; list them in order with --signals",
        ),
        (motion(0.4), JOINTS, ["--episode", "2"], "no episode 2 in data; valid: 0 to 1"),
        (motion(0.4), JOINTS, ["--feature", "action"], "no feature 'action' in data; valid: observation.state"),
        (motion(0.4), JOINTS, ["--signals", "0", "1"], "--signals has 2 signals; valid: 7"),
        (motion(0.4), JOINTS, ["--signals", *"0123459"], "no signal '9' in observation.state; valid: panda_joint1, "),
        (np.full((FRAMES, 7), np.nan), JOINTS, [], "valid: at least 2, all finite"),
        (motion(0.4), JOINTS, ["-o", "a.txt"], "--output is a.txt; valid: a file name .yaml"),
    ],
)
def test_what_cannot_be_replayed_is_refused(
    tmp_path: Path,
    values: np.ndarray,
    names: list[str],
    options: list[str],
    reason: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    dataset = version_3(tmp_path / "data", values, names)
    assert main(["import", str(dataset), "--episode", "1", *options]) == 2
    message = capsys.readouterr().err
    assert reason in message and message.count("\n") == 1
    assert not list(tmp_path.glob("*.yaml"))


@pytest.mark.parametrize(
    ("names", "width", "options", "reason"),
    [
        (JOINTS, 14, [], "observation.state has 7 names for 14 signals; these names do not show"),
        (
            JOINTS,
            14,
            ["--signals", *JOINTS],
            "no signal 'panda_joint1' in observation.state; valid: 7 names for 14 sig",
        ),
        (["gripper", *JOINTS], 7, [], "observation.state has 8 names for 7 signals; these names do not show"),
        ({"left": JOINTS, "right": JOINTS}, 14, ["--signals", *JOINTS], "'panda_joint1' names 2 signals of observ"),
        ([f"tau_j{k}" for k in range(1, 8)], 7, [], "observation.state has tau_j1, "),
        ([f"delta_joint_{k}" for k in range(1, 8)], 7, [], "these names do not show the 7 joints"),
        ([f"panda_joint{k}" for k in (1, 2, 3, 4, 5, 6, 9)], 7, [], "these names do not show the 7 joints"),
        ({name: k for k, name in enumerate(JOINTS)}, 7, [], "observation.state: names are \"{'panda_joint1': 0, "),
        ("state", 7, [], "observation.state: names are 'state'; valid: a list of names, or groups of lists"),
        (JOINTS, 7, ["--signals", "²", *"123456"], "no signal '²' in observation.state; valid: panda_joint1, "),
    ],
)
def test_signals_that_may_not_be_the_positions_of_the_joints_are_refused(
    tmp_path: Path, names: Any, width: int, options: list[str], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    values = np.tile(motion(0.4), width // 7)
    refused(version_2(tmp_path / "data", values, names, width), reason, capsys, *options)


def test_a_file_without_a_column_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dataset = version_2(tmp_path / "data", motion(0.4), JOINTS)
    path = dataset / "data/chunk-000/episode_000001.parquet"
    pandas.read_parquet(path).drop(columns="index").to_parquet(path)
    assert main(["import", str(dataset), "--episode", "1"]) == 2
    assert f"cannot read {path}: no column index\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("about", "reason"),
    [
        ({"fps": 0}, "fps is 0; valid: a finite number from 0.1 to 1000 [Hz]"),
        ({"fps": float("nan")}, "fps is nan; valid: "),
        ({"codebase_version": "v1.6"}, "has version v1.6; valid: LeRobot data sets of version 2 or 3"),
        ({"features": {"observation.state": STATE | {"units": {"motors": ["rad"] * 7}}}}, "has the units {'motors': ["),
        (
            {"features": {"observation.state": STATE | {"units": ["rad"]}}},
            "has the units ['rad']; valid: a list with 7",
        ),
        (
            {"features": {"observation.state": {"dtype": "float32"}}},
            "of version 2 or 3: 'shape' is missing or not known",
        ),
        ({"features": {"index": {"dtype": "int64"}}}, "no feature 'observation.state' in data; valid: none"),
        ({"chunks_size": 0}, "is not a LeRobot data set of version 2 or 3: ZeroDivisionError"),
        ({"features": {"observation.state": None}}, "is not a LeRobot data set of version 2 or 3: AttributeError"),
        (
            {
                "features": {
                    "observation.state": {
                        "dtype": "float32",
                        "shape": [7],
                        "names": JOINTS,
                        "units": ["deg"] + ["rad"] * 6,
                    }
                }
            },
            "reaches 2.356 deg; valid: joint positions in rad",
        ),
    ],
)
def test_a_description_that_is_not_of_a_data_set_is_refused(
    tmp_path: Path, about: dict[str, Any], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset = version_3(tmp_path / "data", motion(0.4), JOINTS)
    info = json.loads((dataset / "meta/info.json").read_text())
    (dataset / "meta/info.json").write_text(json.dumps(info | about))
    refused(dataset, reason, capsys)


def refused(dataset: Path, reason: str, capsys: pytest.CaptureFixture[str], *options: str) -> None:
    output = dataset.parent / "wave.yaml"
    assert main(["import", str(dataset), "--episode", "1", "-o", str(output), *options]) == 2
    message = capsys.readouterr().err
    assert reason in message and message.count("\n") == 1 and not output.exists()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rows: rows[rows["index"] != 50], "index of frame 40 is 51; valid: 50"),  # the episode begins at 10
        (lambda rows: pandas.concat([rows, rows[rows["index"] == 20]]), "index of frame 11 is 20; valid: 21"),
        (
            lambda rows: rows.assign(timestamp=(rows["index"] - 10) / 30),
            "timestamp of frame 1 is 0.0333333; valid: 0.02",
        ),
        (lambda rows: rows.assign(frame_index=(rows["index"] - 10) // 2), "frame_index of frame 1 is 0; valid: 1"),
        (lambda rows: rows.assign(timestamp=float("nan")), "timestamp of frame 0 is nan"),
        (lambda rows: rows[rows.episode_index == 0], "has 0 frames; valid: at least 2"),
        (lambda rows: rows.assign(**{"observation.state": [[0.0] * 8] * len(rows)}), "a frame with 8 values; valid: 7"),
        (
            lambda rows: rows.assign(**{"observation.state": [[0.0] * 7, None] * (len(rows) // 2) + [[0.0] * 7]}),
            "valid: 7",
        ),
    ],
)
def test_frames_that_do_not_give_the_motion_are_refused(
    tmp_path: Path, change: Any, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset = version_3(tmp_path / "data", motion(0.4), JOINTS)
    path = dataset / "data/chunk-000/file-001.parquet"
    change(pandas.read_parquet(path)).to_parquet(path)
    refused(dataset, reason, capsys)


def test_a_frame_with_an_unknown_position_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = motion(0.4)
    values[7, 2] = np.nan
    refused(version_2(tmp_path / "data", values, JOINTS), "has 151 frames, and frame 7 is not finite; valid: ", capsys)


def test_a_pointer_of_git_lfs_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dataset = version_2(tmp_path / "data", motion(0.4), JOINTS)
    path = dataset / "data/chunk-000/episode_000001.parquet"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    refused(dataset, f"{path} is a pointer of Git LFS and not the file; `git lfs pull` fetches it", capsys)


@pytest.mark.parametrize("task", ["wave", None, "wave\n  twice"])
def test_tasks_in_a_column_are_read(tmp_path: Path, task: str | None) -> None:
    dataset = version_2(tmp_path / "data", motion(0.1), JOINTS)
    pandas.DataFrame({"task_index": [0, 1], "task": ["none", task]}).to_parquet(dataset / "meta/tasks.parquet")
    description = yaml.safe_load(imported(dataset).read_text())["description"]
    assert description == f"episode 1 of data: {' '.join((task or '').split())}".rstrip(": ")


@pytest.mark.parametrize("change", [lambda path: pandas.read_parquet(path)[:1].to_parquet(path), Path.unlink])
def test_an_episode_that_no_file_lists_is_refused(
    tmp_path: Path, change: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset = version_3(tmp_path / "data", motion(0.4), JOINTS)
    change(dataset / "meta/episodes/chunk-000/file-000.parquet")
    refused(dataset, "data does not list episode 1 in meta/episodes", capsys)


def test_the_name_of_a_data_set_is_that_of_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = version_3(tmp_path / "data", motion(0.4), JOINTS)
    monkeypatch.chdir(dataset / "meta")
    assert main(["import", "..", "--episode", "1"]) == 0
    assert (dataset / "meta/data_1.yaml").is_file()


@pytest.mark.parametrize("name", ["wave.yaml", "wave.csv"])
def test_an_existing_file_is_not_replaced(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    dataset = version_3(tmp_path / "data", motion(0.4), JOINTS)
    (tmp_path / name).write_text("mine")
    assert main(["import", str(dataset), "--episode", "1", "-o", str(tmp_path / "wave.yaml")]) == 2
    assert f"{name} exists; valid: another name with --output" in capsys.readouterr().err
    assert (tmp_path / name).read_text() == "mine" and len(list(tmp_path.glob("wave.*"))) == 1


def test_a_folder_without_data_set_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(tmp_path)]) == 2
    assert "is not a LeRobot data set of version 2 or 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("time,a\n0,1\n", "at least two times that rise from 0"),
        ("time,a\n0,1\n0,2\n", "at least two times that rise from 0"),
        ("time,a\n0,1\n1,nan\n", "finite values"),
        ("a,b\n0,1\n1,2\n", "valid: time and the name of each joint"),
        ("time,a\n0,x\n", "trajectory file"),
        (None, "No such file"),
    ],
)
def test_a_file_that_is_no_trajectory_is_refused_before_the_run(
    tmp_path: Path, content: str | None, reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = imported(version_3(tmp_path / "data", motion(0.4), JOINTS))
    path.with_suffix(".csv").unlink()
    if content is not None:
        path.with_suffix(".csv").write_text(content)
    assert main(["run", str(path), "--runs", str(tmp_path / "runs")]) == 2
    assert reason in capsys.readouterr().err and not (tmp_path / "runs").exists()


def test_a_controller_that_is_not_started_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = imported(version_3(tmp_path / "data", motion(0.4), JOINTS))
    content = yaml.safe_load(path.read_text())
    content["replay"]["controller"] = "effort_joint_trajectory_controller"
    path.write_text(yaml.safe_dump(content))
    assert main(["run", str(path), "--runs", str(tmp_path / "runs"), "--quiet"]) == 2
    assert "no controller 'effort_joint_trajectory_controller' in replay.controller; valid: " in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


def test_an_episode_is_replayed_by_one_of_two_arms(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = imported(version_3(tmp_path / "data", motion(0.4), JOINTS))
    arms = ["arms:=left,right", "replay.controller:=left/position_joint_trajectory_controller"]
    assert main(["run", str(path), *arms, "--runs", str(tmp_path / "runs"), "--quiet"]) == 2
    assert "has the joints panda_joint1, " in (error := capsys.readouterr().err) and "valid: those of left/" in error
    csv = path.with_suffix(".csv")
    csv.write_text(csv.read_text().replace("panda_", "left_"))
    record, _ = replayed(path, tmp_path / "runs", *arms)
    moved = np.ptp(record.log.position, axis=0)
    assert moved[:7].min() > 0.1 and moved[7:].max() < 1e-3


@pytest.mark.parametrize(
    ("robot", "said"),
    [("Franka", ""), ("xarm7", "robot_type of data is 'xarm7'"), (None, "robot_type of data is not known")],
)
def test_another_robot_than_the_panda_is_named(
    tmp_path: Path, robot: str | None, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset = version_3(tmp_path / "data", motion(0.1), JOINTS)
    path = dataset / "meta/info.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"robot_type": robot}))
    imported(dataset)
    shown = capsys.readouterr().out
    assert said in shown and ("robot_type" in shown) is bool(said)
