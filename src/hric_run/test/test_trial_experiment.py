"""A recorded trial in an experiment file: the arm follows the marker of a laboratory's c3d file."""

from pathlib import Path

import c3d_files
import numpy as np
import pytest
import yaml
from c3d_files import RATE, Lab

from hric_bags.export import recording
from hric_bags.export.trial.replayed_trial import of_run
from hric_core.errors import HricError
from hric_core.trial.description import replayed_trials
from hric_report import headless
from hric_run.definition import experiment, parameters

FRAMES = 150


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Experiment file with the recorded trial in the same folder."""
    folder = tmp_path_factory.mktemp("c3d")
    markers = {label: p + np.array([100.0, 0.0, 0.0]) for label, p in c3d_files.swinging(FRAMES)[0].items()}
    emg = np.zeros(FRAMES * c3d_files.PER_FRAME)
    lab = Lab(markers, {"EMG1": ("V", emg), "EMG2": ("V", emg)}, [(2, np.zeros((len(emg), 6)))])
    c3d_files.write(folder / "trial.c3d", lab)
    raw = yaml.safe_load((experiment.config_path("experiments") / "marker_tracking.yaml").read_text())
    raw["mocap"] |= {"human": {"program": "c3d", "path": "trial.c3d"}, "stream": {"rate": 100}}
    (folder / "replay.yaml").write_text(yaml.safe_dump({**raw, "duration": 1.0}))
    return folder / "replay.yaml"


def test_a_headless_run_replays_the_markers_of_the_file_beside_the_experiment(file: Path, tmp_path: Path) -> None:
    folder = headless.run(experiment.load(str(file)), (), root=tmp_path, progress=False, figures=False).folder
    frames = recording.read(recording.find(str(folder.path)), ("/hric/perception/mocap",))["/hric/perception/mocap"]
    p = np.column_stack([frames.below("rigid_bodies.hand.pose.position")[axis] for axis in "xyz"])
    x, y, z = (c3d_files.swinging(FRAMES)[1] + np.array([0.1, 0.0, 0.0])).T
    place = (frames.time - 1e-3) * RATE  # the program begins in the first millisecond
    exact = np.column_stack([np.interp(place, np.arange(FRAMES), values) for values in (x, y, z)])
    assert len(p) > 90 and np.abs(p - exact).max() < 1e-6
    told = folder.read()
    assert told["definition"]["mocap"]["human"]["path"] == "trial.c3d" and str(file.parent) not in yaml.safe_dump(told)


def test_files_of_the_same_name_have_entries_of_their_own(tmp_path: Path) -> None:
    """Markers replay a file, plate and EMG another one of the same name in another folder."""
    paths = []
    for label in ("HAND_1", "ELBOW_1"):
        (tmp_path / label).mkdir()
        p = np.full((FRAMES, 3), 100.0)
        paths.append(c3d_files.write(tmp_path / label / "trial.c3d", Lab({label: p}, {}, [(2, np.zeros((1500, 6)))])))
    first, second = ({"program": "c3d", "path": str(path)} for path in paths)
    sensors = {"force_plate": {"emulated": {"load": second}}, "emg": {"emulated": {"activation": second}}}
    tree, trials = replayed_trials({"mocap": {"human": first}, **sensors})
    assert {name: about["labels"] for name, about in trials.items()} == {
        "trial.c3d": ["HAND_1"],
        "trial_2.c3d": ["ELBOW_1"],
    }
    assert str(tmp_path) not in str(tree) and "force_plate" in str(tree)
    replayed = of_run({"definition": tree, "trials": trials})
    assert replayed is not None and replayed.name == "trial.c3d" and replayed.plate is None
    same, trials = replayed_trials({"mocap": {"human": first}, "force_plate": {"emulated": {"load": first}}})
    replayed = of_run({"definition": same, "trials": trials})
    assert replayed is not None and replayed.plate == ("1", 1) and set(trials) == {"trial.c3d"}


def test_nodes_get_the_path_of_the_trial_from_the_root(file: Path) -> None:
    raw = yaml.safe_load(file.read_text())
    raw["emg"] = {
        "channels": ["a", "b"],
        "emulated": {"activation": {"program": "c3d", "path": "trial.c3d", "channels": ["EMG1", "EMG2"]}},
    }
    raw["force_plate"] = {"emulated": {"load": {"program": "c3d", "path": "trial.c3d"}}}
    (file.parent / "all.yaml").write_text(yaml.safe_dump(raw))
    whole = experiment.load(str(file.parent / "all.yaml"))
    nodes = parameters.sensors(whole)
    wanted = str(file.parent / "trial.c3d")
    assert nodes["emulated_emg"]["activation"]["path"] == nodes["emulated_plate"]["load"]["path"] == wanted
    assert parameters.mocap(whole)["emulated_human"]["human"]["path"] == wanted


def test_a_trial_that_is_not_there_is_one_line_of_the_experiment(file: Path) -> None:
    with pytest.raises(
        HricError, match=r"experiment replay: mocap.human.path: c3d file .*/nothing.c3d: No such file or directory"
    ):
        experiment.load(str(file), ("mocap.human.path:=nothing.c3d",))
