"""Exports to NumPy, CSV, Parquet and an un-batched bag, read back as users read them."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import export_bags
import numpy as np
import pandas
import pyarrow.parquet
import pytest
import rosbag
import rospy
from export_bags import EMG_RATE, FRAMES, HIDDEN, Truth
from sensor_msgs.msg import JointState

from hric_bags import reader as bag_reader
from hric_bags.export import exporting, output, recording
from hric_bags.export.job import FORMATS, ExportRequest
from hric_bags.files import FileError
from hric_bags.health.examine import examine
from hric_bags.run_folder import RunFolder
from hric_core.command import main


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return export_bags.write(tmp_path_factory.mktemp("bag") / "made_up.bag")


def export(truth: Truth, folder: Path, *formats: str, topics: tuple[str, ...] = ()) -> exporting.ExportResult:
    return exporting.export(recording.find(str(truth.bag)), ExportRequest(formats, topics), folder)


def from_npz(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    with np.load(path) as file:
        about = json.loads(str(file["about"]))
        return {name: file[name] for name in file.files if name != "about"}, about


def from_csv(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    comments = [line[2:] for line in path.read_text().splitlines() if line.startswith("# ")]
    units = dict(line.removeprefix("unit of ").rsplit(": ", 1) for line in comments if line.startswith("unit of "))
    about = {
        key: json.loads(value)
        for key, value in (line.split(": ", 1) for line in comments if not line.startswith("unit of "))
    }
    frame = pandas.read_csv(path, comment="#")
    return {name: frame[name].to_numpy() for name in frame}, {**about, "units": units}


def from_parquet(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    frame = pandas.read_parquet(path)
    schema = pyarrow.parquet.read_schema(path)
    about = json.loads(schema.metadata[b"hric"])
    assert {name: schema.field(name).metadata[b"unit"].decode() for name in schema.names} == about["units"]
    return {name: frame[name].to_numpy() for name in frame}, about


READERS = {"npz": from_npz, "csv": from_csv, "parquet": from_parquet}


@pytest.mark.parametrize(("kind", "reader"), READERS.items())
def test_what_is_exported_reads_back_equal_with_units_axes_and_rate(
    truth: Truth, tmp_path: Path, kind: str, reader: Callable[..., Any]
) -> None:
    export(truth, tmp_path, kind)
    log, about = reader(tmp_path / kind / f"control_log.{kind}")
    assert np.array_equal(log["time"], truth.log[0])
    assert np.array_equal(log["position.j2"], truth.log[1][:, 1]) and np.array_equal(
        log["velocity.j3"], truth.log[2][:, 2]
    )
    assert (about["units"]["position.j2"], about["units"]["command.j1"], about["units"]["time"]) == ("rad", "N m", "s")
    assert about["rate"] == pytest.approx(1000.0) and "right-handed" in about["axes"]
    emg, about = reader(tmp_path / kind / f"hric.perception.emg.raw.{kind}")
    assert np.array_equal(np.column_stack([emg["biceps"], emg["triceps"]]), truth.emg)
    assert np.array_equal(emg["sample"], np.arange(800)) and np.array_equal(
        emg["stamp"], np.arange(800) * round(1e9 / EMG_RATE)
    )
    assert about["units"]["biceps"] == "V" and "rate reported by the source: 2000 Hz" in about["notes"]
    mocap, about = reader(tmp_path / kind / f"hric.perception.mocap.{kind}")
    assert np.array_equal(mocap["rigid_bodies.hand.pose.position.y"], truth.p[:, 1])
    hidden = np.isnan(mocap["labelled_markers.hand/2.x"])
    assert list(np.flatnonzero(hidden)) == list(HIDDEN) and len(hidden) == FRAMES
    assert about["frame"] == "mocap" and about["units"]["labelled_markers.hand/2.x"] == "m"
    _, about = reader(tmp_path / kind / f"hric.perception.force_plate.left.samples.{kind}")
    assert (about["units"]["Fz"], about["units"]["Mx"]) == ("N", "N m")
    note, _ = reader(tmp_path / kind / f"note.{kind}")
    assert list(note["data"]) == ["one, with a comma"]
    said, _ = reader(tmp_path / kind / f"rosout.{kind}")
    assert list(said["file"]) == ["a.py"] and list(said["msg"]) == ['said "so",\non two lines # and more']


@pytest.mark.parametrize(("kind", "reader"), READERS.items())
def test_a_field_that_is_called_time_is_beside_the_time(
    truth: Truth, tmp_path: Path, kind: str, reader: Callable[..., Any]
) -> None:
    export(truth, tmp_path, kind, topics=("/franka_states",))
    states, about = reader(tmp_path / kind / f"franka_states.{kind}")
    assert list(states["field.time"]) == [100.0, 101.0, 102.0] and list(states["time"]) == [0.0, 0.5, 1.0]
    assert about["units"]["field.time"] == "s" and about["units"]["q.3"] == "rad"


def test_synchronised_samples_have_the_names_and_units_of_their_layout(truth: Truth, tmp_path: Path) -> None:
    export(truth, tmp_path, "npz", topics=("/hric/perception/sync", "/hric/perception/sync_layout"))
    synced, about = from_npz(tmp_path / "npz" / "hric.perception.sync.npz")
    assert np.array_equal(synced["q2"], -0.1 * np.arange(40)) and about["units"]["biceps"] == "V"
    assert synced["valid./hric/perception/emg/raw"].tolist() == [False] + [True] * 39
    assert not (tmp_path / "npz" / "control_log.npz").exists()


def test_the_time_of_a_bag_without_control_log_counts_from_its_first_recording(tmp_path: Path) -> None:
    with rosbag.Bag(str(tmp_path / "a.bag"), "w") as bag:
        for k in range(3):
            state = JointState(name=["a"], position=[float(k)])
            state.header.stamp = rospy.Time(1_700_000_000, k * 10_000_000 + 123)
            bag.write("/joint_states", state, rospy.Time(1_700_000_000, 0))
    table = recording.read(recording.find(str(tmp_path / "a.bag")))["/joint_states"]
    assert (
        table.time == pytest.approx([123e-9, 0.010000123, 0.020000123], abs=1e-12)
        and table.clock == recording.BAG_CLOCK
    )
    assert table.stamp.tolist() == [1_700_000_000_000_000_123 + k * 10_000_000 for k in range(3)]


def test_values_of_sliding_joints_are_metres(truth: Truth) -> None:
    urdf = '<robot name="r"><joint name="b" type="prismatic"/></robot>'
    found = recording.read(recording.ExportSource((truth.bag,), None, {}, urdf), ["/joint_states"])["/joint_states"]
    units = {column.name: column.unit for column in found.columns}
    assert (units["position.a"], units["position.b"], units["velocity.b"]) == ("rad", "m", "m/s")


def test_an_unbatched_bag_has_one_message_per_sample_and_the_same_contents(truth: Truth, tmp_path: Path) -> None:
    (path,) = export(truth, tmp_path, "bag").files["bag"]
    counts = {stream.topic: len(stream.recorded) for stream in examine(path).streams}
    assert (counts["/control_log"], counts["/hric/perception/emg/raw"], counts["/joint_states"]) == (400, 800, 40)
    assert examine(path).code == 0
    before, after = bag_reader.read(truth.bag).log, bag_reader.read(path).log
    assert after.state_sha256() == before.state_sha256() and np.array_equal(after.time, before.time)
    tables = [
        recording.read(recording.find(str(bag)), ["/hric/perception/emg/raw"]).popitem()[1] for bag in (truth.bag, path)
    ]
    assert np.array_equal(tables[0].stamp, tables[1].stamp) and np.array_equal(
        tables[1].columns[1].values, truth.emg[:, 0]
    )


def test_a_run_recorded_in_parts_that_overlap_is_exported_once(truth: Truth, tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "split")
    names = [f"{folder.path.name}_{k}.bag" for k in range(2)]
    folder.write({"experiment": "split", "bag": names[0], "bags": names})
    with rosbag.Bag(str(truth.bag)) as bag:
        for name, begin, end in ((names[0], 0.0, 0.25), (names[1], 0.2, 10.0)):
            with rosbag.Bag(str(folder.path / name), "w") as part:
                for topic, raw, time in bag.read_messages(raw=True):
                    if begin <= time.to_sec() < end or topic == "/tf_static":
                        # Each recorder notes when it received a message itself.
                        part.write(topic, raw, time + rospy.Duration(0, 1000 if begin else 0), raw=True)
    whole, parts = (recording.read(recording.find(str(path))) for path in (truth.bag, folder.path))
    for topic in ("/control_log", "/hric/perception/emg/raw", "/joint_states", "/hric/perception/mocap"):
        assert np.array_equal(whole[topic].stamp, parts[topic].stamp), topic
    assert main(["export", str(folder.path), "--format", "bag"]) == 0
    (path,) = (folder.path / "export" / "bag").iterdir()
    assert {s.topic: len(s.recorded) for s in examine(path).streams}["/hric/perception/emg/raw"] == 800
    assert main(["health", str(folder.path), "--quiet"]) == 0


def test_an_interrupted_export_goes_on_where_it_ended(
    truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from hric_bags.export import plain_formats

    write, seen = plain_formats.WRITERS["npz"], []

    def interrupted(table: Any, path: Path) -> None:
        seen.append(table.topic)
        if len(seen) == 4:
            path.write_bytes(b"half of it")
            raise KeyboardInterrupt
        write(table, path)

    monkeypatch.setitem(plain_formats.WRITERS, "npz", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export(truth, tmp_path, "npz")
    assert len(list((tmp_path / "npz").iterdir())) == 3
    done = export(truth, tmp_path, "npz")
    assert (
        seen[4:] == sorted(recording.read(recording.find(str(truth.bag))))[3:]
        and len(done.files["npz"]) == len(seen) - 1
    )
    assert export(truth, tmp_path, "npz").seconds == {}


def test_an_export_of_a_bag_that_changed_is_made_again(tmp_path: Path) -> None:
    truth = export_bags.write(tmp_path / "made_up.bag")
    export(truth, tmp_path / "out", "csv", topics=("/note",))
    truth.bag.touch()
    assert list(export(truth, tmp_path / "out", "csv", topics=("/note",)).seconds) == ["csv"]


def test_files_of_others_in_the_folder_are_not_replaced(truth: Truth, tmp_path: Path) -> None:
    file = tmp_path / "csv/joint_states.csv"
    file.parent.mkdir()
    file.write_text("mine")
    request = ExportRequest(("csv", "parquet"), ("/joint_states",))
    for _ in range(2):
        result = exporting.export(recording.find(str(truth.bag)), request, tmp_path)
        assert "joint_states.csv is not from an export; valid: another folder, or " in result.failures["csv"]
        assert file.read_text() == "mine" and list(result.files) == ["parquet"]
    assert not exporting.export(recording.find(str(truth.bag)), request, tmp_path, again=True).failures
    assert file.read_text() != "mine"


def test_files_of_an_earlier_export_with_other_settings_are_replaced(truth: Truth, tmp_path: Path) -> None:
    for formats, topics in ((("csv", "parquet"), ("/note",)), (("csv",), ()), (("parquet",), ())):
        request = ExportRequest(formats, topics)
        assert not exporting.export(recording.find(str(truth.bag)), request, tmp_path).failures


def test_a_disk_that_refuses_leaves_no_half_file(tmp_path: Path) -> None:
    def refuse(path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(FileError, match="No space left on device"):
        output.ExportFolder(tmp_path, []).write("csv", "a.csv", refuse)
    assert not list((tmp_path / "csv").iterdir())


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            ["--format", "xls"],
            "no format 'xls'; valid: bag, bids, c3d, csv, external_loads, lerobot, mcap, mot, npz, parquet, ",
        ),
        (["--format", "npz", "--topics", "/nothing"], "no topic '/nothing' in the bag; valid: /control_log, "),
    ],
)
def test_a_wrong_argument_is_one_line_with_the_valid_choices(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], reason: str
) -> None:
    assert main(["export", str(truth.bag), "--output", str(tmp_path / "out"), *arguments]) == 2
    message = capsys.readouterr().err
    assert reason in message and message.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_format_that_cannot_be_written_does_not_keep_the_others_from_it(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from hric_bags.export import opensim_formats

    def broken(*_: Any) -> None:
        raise ValueError("no\nsuch thing")

    monkeypatch.setattr(opensim_formats, "write_signals", broken)
    topics = ["--topics", "/joint_states", "/note", "--output", str(tmp_path), "--quiet"]
    assert main(["export", str(truth.bag), "--format", "trc", "sto", "mot", "csv", *topics]) == 1
    said = capsys.readouterr()
    assert [line.split()[0] for line in said.out.splitlines() if "files," in line] == ["mot", "csv"]
    failed = said.err.splitlines()
    assert len(failed) == 2 and failed[0].startswith("export: trc was not written: format trc needs motion capture")
    assert failed[1] == "export: sto was not written: ValueError: no such thing"
    assert (tmp_path / "mot" / "joint_states.mot").is_file() and not list((tmp_path).glob("sto/*"))
    monkeypatch.undo()
    assert main(["export", str(truth.bag), "--format", "sto", "mot", *topics]) == 0  # and goes on where it failed


def test_a_disk_that_refuses_one_format_is_reported_and_the_others_are_written(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "npz").write_text("in the way")
    assert (
        main(
            [
                "export",
                str(truth.bag),
                "--format",
                "npz",
                "csv",
                "--topics",
                "/note",
                "--output",
                str(tmp_path),
                "--quiet",
            ]
        )
        == 1
    )
    said = capsys.readouterr().err
    assert said.startswith("export: npz was not written: cannot write ") and said.count("\n") == 1
    assert (tmp_path / "csv" / "note.csv").is_file()


def test_external_loads_without_a_plate_say_so_and_the_export_goes_on(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--format", "external_loads", "csv", "--topics", "/note", "--output", str(tmp_path), "--quiet"]
    assert main(["export", str(truth.bag), *arguments]) == 0
    said = capsys.readouterr()
    (line,) = [line for line in said.out.splitlines() if line.startswith("external_loads")]
    assert "no force plate" in line and said.err == ""
    assert (tmp_path / "csv" / "note.csv").is_file() and not (tmp_path / "external_loads").exists()


def test_export_and_health_load_nothing_of_ros(truth: Truth, tmp_path: Path) -> None:
    program = (
        "import sys; from hric_core.command import main\n"
        f"assert main(['export', {str(truth.bag)!r}, '--output', {str(tmp_path)!r}, '--format', "
        f"*{FORMATS!r}]) == 0\n"
        f"assert main(['health', {str(truth.bag)!r}, '--quiet']) == 0\n"
        "print(sorted({'rospy', 'rosbag', 'genpy', 'roslib', 'std_msgs'} & set(sys.modules)))"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines()[-1] == "[]"


def test_a_damaged_bag_is_refused_with_the_way_to_salvage_it(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = tmp_path / "cut.bag"
    cut.write_bytes(truth.bag.read_bytes()[:20000])
    assert main(["export", str(cut), "--format", "npz"]) == 2
    assert "health --salvage" in capsys.readouterr().err
