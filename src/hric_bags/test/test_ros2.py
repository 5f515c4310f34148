"""Bags of ROS 2: export as MCAP and SQLite, opened by a reader of another project, and read again."""

import shutil
import sqlite3
from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any

import export_bags
import numpy as np
import pytest
import yaml
from export_bags import Truth

from hric_bags import foreign, ros2
from hric_bags.export import exporting, recording
from hric_bags.export.exporting import ExportRequest
from hric_bags.indexed import BagError
from hric_bags.parts import PartsReader
from hric_bags.run_folder import workspace
from hric_core.command import main

MESSAGES = workspace() / "src"


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return export_bags.write(tmp_path_factory.mktemp("bag") / "made_up.bag")


@pytest.fixture(scope="module")
def exported(truth: Truth, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    assert not export(truth.bag, folder).failures
    return folder


def export(bag: Path, folder: Path, **request: Any) -> exporting.ExportResult:
    return exporting.export(recording.find(str(bag)), ExportRequest(("mcap", "ros2"), **request), folder)


def contents(bag: Path) -> list[tuple[str, str, int, Any]]:
    """Return (topic, type, recording time, message without `seq`, which ROS 2 does not have) of all messages."""
    with PartsReader(bag) as reader:
        return [
            (c.topic, c.msgtype, time, plain(reader.deserialize(raw, c.msgtype))) for c, time, raw in reader.messages()
        ]


def plain(value: Any) -> Any:
    """Return a message of any library as nested lists, without `seq` of headers and without names of fields."""
    names = getattr(value, "__slots__", None)
    if is_dataclass(value):  # a field with a default is a constant
        names = [field.name for field in fields(value) if field.default is MISSING]
    if names is not None:
        return [plain(getattr(value, name)) for name in names if name not in ("seq", "__msgtype__")]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def by_topic(items: list[tuple[str, str, int, Any]]) -> dict[str, list[Any]]:
    topics: dict[str, list[Any]] = {}
    for topic, *item in items:
        topics.setdefault(topic, []).append(item)
    return topics


@pytest.mark.parametrize(
    ("kind", "name"), [("mcap", ""), ("ros2", ""), ("mcap", "made_up.mcap"), ("ros2", "made_up.db3")]
)
def test_every_message_reads_back_equal(truth: Truth, exported: Path, kind: str, name: str) -> None:
    assert by_topic(contents(exported / kind / name)) == by_topic(contents(truth.bag))


def test_a_reader_of_another_project_finds_every_value(truth: Truth, exported: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    factory = pytest.importorskip("mcap_ros2.decoder").DecoderFactory()
    with (exported / "mcap" / "made_up.mcap").open("rb") as file:
        found = [
            (channel.topic, schema.name, message.log_time, plain(decoded))
            for schema, channel, message, decoded in reader.make_reader(
                file, decoder_factories=[factory]
            ).iter_decoded_messages()
        ]
    assert by_topic(found) == by_topic(contents(truth.bag))


def test_fields_in_upper_case_have_the_names_of_franka_ros2() -> None:
    fields = [
        line.split("#")[0].split()[1]
        for line in (MESSAGES / "franka_msgs/msg/FrankaState.msg").read_text().splitlines()
        if line.strip() and not line.startswith("#") and "=" not in line.split("#")[0]
    ]
    assert {name for name in fields if not name.islower()} == set(ros2.NAMES_IN_ROS1.values())


@pytest.mark.parametrize("file", sorted(MESSAGES.glob("*_msgs/msg/*.msg")), ids=lambda path: path.stem)
def test_all_other_fields_are_permitted_by_ros_2(file: Path) -> None:
    for line in file.read_text().splitlines():
        words = line.split("#")[0].split()
        if len(words) >= 2 and "=" not in line.split("#")[0] and file.stem != "FrankaState":
            name = words[1]
            assert name == name.lower() and "__" not in name and not name.endswith("_"), (file, name)


def test_only_requested_topics_are_written(truth: Truth, tmp_path: Path) -> None:
    assert not export(truth.bag, tmp_path, topics=("/joint_states",)).failures
    assert {topic for topic, *_ in contents(tmp_path / "mcap")} == {"/joint_states"}


def test_an_anonymised_bag_has_no_topic_that_may_identify_a_person(truth: Truth, tmp_path: Path) -> None:
    result = export(truth.bag, tmp_path, anonymise=())
    topics = {topic for topic, *_ in contents(tmp_path / "mcap")}
    assert not result.failures and "/joint_states" in topics and not {"/note", "/rosout"} & topics
    assert b"with a comma" not in (tmp_path / "ros2" / "recording.db3").read_bytes()


def test_a_bag_of_ros_2_is_exported_as_the_bag_that_it_came_from(truth: Truth, exported: Path, tmp_path: Path) -> None:
    for bag, name in ((truth.bag, "ros1"), (exported / "mcap", "ros2")):
        exporting.export(recording.find(str(bag)), ExportRequest(("csv",)), tmp_path / name)
    ours, theirs = (
        {path.name: path.read_text() for path in (tmp_path / name / "csv").iterdir()} for name in ("ros1", "ros2")
    )
    assert len(ours) > 5 and theirs == ours


@pytest.mark.parametrize("size", [10, 400, 20_000])
@pytest.mark.parametrize("file", ["mcap/made_up.mcap", "ros2/made_up.db3"])
def test_a_file_that_ends_too_early_is_refused_in_one_sentence(
    exported: Path, tmp_path: Path, size: int, file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / Path(file).name
    path.write_bytes((exported / file).read_bytes()[:size])
    assert main(["export", str(path), "--format", "csv"]) in (1, 2)
    message = capsys.readouterr().err
    assert path.name in message and message.count("\n") == 1 and "Traceback" not in message


@pytest.mark.parametrize("kind", ["mcap", "ros2"])
def test_a_bag_of_ros_2_has_the_health_of_the_bag_that_it_came_from(
    truth: Truth, exported: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    reports = [(main(["health", str(bag)]), capsys.readouterr().out) for bag in (truth.bag, exported / kind)]
    (code, ours), (other, theirs) = ((code, text.splitlines()[1:]) for code, text in reports)
    assert (code, ours) == (other, theirs) and len(ours) > 10


def test_a_changed_byte_in_a_chunk_is_found(exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, content = tmp_path / "cut.mcap", (exported / "mcap" / "made_up.mcap").read_bytes()
    with (exported / "mcap" / "made_up.mcap").open("rb") as file:
        reader = pytest.importorskip("mcap.reader").make_reader(file, validate_crcs=True)
        (chunk,) = reader.get_summary().chunk_indexes
        assert len(list(reader.iter_messages())) > 100
    for place in np.linspace(chunk.chunk_start_offset + 60, chunk.chunk_start_offset + chunk.chunk_length - 1, 10):
        path.write_bytes(content[: int(place)] + bytes([content[int(place)] ^ 1]) + content[int(place) + 1 :])
        assert main(["health", str(path)]) == 4
        text = capsys.readouterr().out
        assert "damaged: cannot read cut.mcap, a bag of ROS 2" in text and "`mcap recover`" in text
    assert main(["health", str(path), "--salvage"]) == 2
    assert "--salvage is for bags of ROS 1" in capsys.readouterr().err


def test_a_run_folder_is_no_bag(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("")
    assert foreign.is_ros2(tmp_path)
    (tmp_path / "run.yaml").write_text("")
    assert not foreign.is_ros2(tmp_path)


def split(exported: Path, kind: str, folder: Path, belongs: Callable[[int], bool]) -> Path:
    """Write a bag of two files, of which the second has the messages that `belongs` chooses by their number."""
    with ros2.Ros2Reader(exported / kind) as reader:
        stored = [(c.topic, time, raw) for c, time, raw in super(ros2.Ros2Reader, reader).messages()]
        kinds, types = {c.topic: c.msgtype for c in reader.connections}, reader.typestore
    shutil.copytree(exported / kind, folder)
    content = yaml.safe_load((folder / "metadata.yaml").read_text())
    content["rosbag2_bagfile_information"]["relative_file_paths"] = []
    for part in (True, False):
        name = f"{folder.name}_{part:d}"
        with ros2.Writer(folder.parent / name, version=8, storage_plugin=ros2.STORAGES[kind]) as writer:
            added = {topic: writer.add_connection(topic, kinds[topic], typestore=types) for topic in kinds}
            for number, (topic, time, raw) in enumerate(stored):
                if belongs(number) == part:
                    writer.write(added[topic], time, raw)
        (file,) = (folder.parent / name).glob(f"{name}.*")
        file.rename(folder / file.name)
        content["rosbag2_bagfile_information"]["relative_file_paths"].append(file.name)
    for topic in content["rosbag2_bagfile_information"]["topics_with_message_count"]:
        topic["topic_metadata"]["offered_qos_profiles"] = ""
    (folder / "metadata.yaml").write_text(yaml.safe_dump(content))
    return folder


@pytest.mark.parametrize("kind", ["mcap", "ros2"])
@pytest.mark.parametrize("belongs", [lambda k: k >= 200, lambda k: k < 200, lambda k: k % 2 == 0])
def test_messages_of_several_files_are_in_the_order_of_time(
    truth: Truth, exported: Path, tmp_path: Path, kind: str, belongs: Callable[[int], bool]
) -> None:
    found = contents(split(exported, kind, tmp_path / "bag", belongs))
    assert [time for _, _, time, _ in found] == sorted(time for _, _, time, _ in found)
    assert by_topic(found) == by_topic(contents(truth.bag))


def indexed(
    exported: Path, target: Path, added: tuple[str, str, str, bytes] | None = None, later: int = 0, **settings: Any
) -> None:
    """Write the exported MCAP file again with the library of MCAP's authors.

    added: a topic with one message, and name, encoding and text of its type; later: added to times [ns].
    """
    reader, writer = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap.writer")
    with (exported / "mcap/made_up.mcap").open("rb") as file, target.open("wb") as new:
        copy = writer.Writer(new, **settings)
        copy.start(profile="ros2")
        numbers: dict[str, int] = {}
        if added is not None:
            kind = copy.register_schema(*added[1:]) if added[1] else 0
            copy.add_message(copy.register_channel(added[0], "cdr", kind), 1, b"\0\1\0\0\xff", 1)
        for schema, channel, message in reader.make_reader(file).iter_messages():
            if channel.topic not in numbers:
                kind = copy.register_schema(schema.name, schema.encoding, schema.data)
                numbers[channel.topic] = copy.register_channel(channel.topic, "cdr", kind, channel.metadata)
            copy.add_message(numbers[channel.topic], message.log_time + later, message.data, message.publish_time)
        copy.finish()


@pytest.mark.parametrize("settings", ["chunks", "uncounted", "names"])
def test_an_mcap_file_whose_index_leads_to_no_messages_is_not_read_as_an_empty_bag(
    exported: Path, tmp_path: Path, settings: str, capsys: pytest.CaptureFixture[str]
) -> None:
    kinds = pytest.importorskip("mcap.writer").IndexType
    chunks = {"index_types": kinds.CHUNK, "use_statistics": settings == "chunks"}
    names = {"use_statistics": False, "repeat_channels": False, "repeat_schemas": False}
    indexed(exported, tmp_path / "a.mcap", **(names if settings == "names" else chunks))
    assert main(["assess", str(tmp_path / "a.mcap")]) == 2
    message = capsys.readouterr().err
    assert "it has 0 of " in message and "`mcap recover`" in message and message.count("\n") == 1


def refused(bag: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line with which the export of a bag is refused; nothing is written."""
    output = bag.with_name("output")
    assert main(["export", str(bag), "--format", "csv", "--output", str(output)]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1 and not output.exists()
    return message


@pytest.mark.parametrize(
    ("added", "reason"),
    [
        (("/odd", "A", "jsonschema", b"{}"), "'jsonschema' is missing or not known; valid: messages of ROS 2 "),
        (
            ("/odd", "A", "protobuf", b"\xff"),
            "; valid: messages of ROS 2 (ros2msg, ros2idl) on all topics; `mcap filter` leaves",
        ),
        (("/odd", "", "", b""), "Type '__schemaless__' is unknown; valid: messages of ROS 2 "),
        (
            ("/odd", "a_msgs/msg/A", "ros2msg", b"a_msgs/B b"),
            "Type 'a_msgs/msg/B' is unknown; valid: messages of ROS 2 ",
        ),
        (("/odd", "std_msgs/msg/UInt8", "ros2msg", b"uint8[] data"), "a message of /odd: "),
        (
            ("/joint_states", "std_msgs/msg/UInt8", "ros2msg", b"uint8 data"),
            "/joint_states has messages of two types; valid: one; ",
        ),
    ],
)
def test_a_topic_that_cannot_be_read_is_named_with_what_is_valid(
    exported: Path, tmp_path: Path, added: tuple[str, str, str, bytes], reason: str, capsys: pytest.CaptureFixture[str]
) -> None:
    indexed(exported, tmp_path / "a.mcap", added)
    assert reason in refused(tmp_path / "a.mcap", capsys)


@pytest.mark.parametrize("command", ["health", "assess"])
def test_a_recording_time_that_ros_cannot_have_is_refused(
    exported: Path, tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    indexed(exported, tmp_path / "a.mcap", later=2**63)
    assert main([command, str(tmp_path / "a.mcap")]) in (2, 4)
    assert "was recorded at 9223372" in "".join(capsys.readouterr())


def test_a_file_that_was_not_closed_is_to_be_recovered(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.mcap").write_bytes((exported / "mcap/made_up.mcap").read_bytes()[:-9])
    assert "; `mcap recover` repairs a file that was not closed" in refused(tmp_path / "a.mcap", capsys)


def test_a_bag_of_humble_has_no_definitions_and_the_message_says_so(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, connection = database(exported, tmp_path / "bag")
    connection.execute("DELETE FROM message_definitions")
    connection.commit()
    connection.close()
    assert "it has no definitions of its message types, as SQLite files of ROS 2 Humble; `ros2 bag convert`" in refused(
        file.parent, capsys
    )


def database(exported: Path, folder: Path) -> tuple[Path, sqlite3.Connection]:
    shutil.copytree(exported / "ros2", folder)
    return folder / "made_up.db3", sqlite3.connect(folder / "made_up.db3")


def test_a_bag_with_fewer_messages_than_its_metadata_lists_is_refused(exported: Path, tmp_path: Path) -> None:
    file, connection = database(exported, tmp_path / "bag")
    connection.execute("DELETE FROM messages WHERE id IN (SELECT MAX(id) FROM messages)")
    connection.commit()
    connection.close()
    with pytest.raises(BagError, match=r"it has \d+ of \d+ messages of /.*`ros2 bag reindex`"):
        contents(file.parent)


def test_changes_next_to_an_sqlite_file_are_not_ignored(exported: Path, tmp_path: Path) -> None:
    file, connection = database(exported, tmp_path / "bag")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("UPDATE messages SET timestamp = timestamp + 1")
    connection.commit()
    for bag in (file, file.parent):
        with pytest.raises(
            BagError, match=r"made_up.db3-wal has messages that .* lacks; `sqlite3 made_up.db3 .tables` adds them"
        ):
            contents(bag)
    connection.close()
    assert min(time for _, _, time, _ in contents(file)) > min(time for _, _, time, _ in contents(exported / "ros2"))


def test_a_definition_without_a_field_that_is_read_is_refused_by_its_name(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, connection = database(exported, tmp_path / "bag")
    connection.execute(
        "UPDATE message_definitions SET encoded_message_definition = "
        "REPLACE(encoded_message_definition, 'n_cycles', 'cycles'), type_description_hash = ''"
    )
    connection.execute("UPDATE topics SET type_description_hash = ''")
    connection.commit()
    connection.close()
    assert main(["export", str(file), "--format", "csv", "--output", str(tmp_path / "out")]) == 2
    assert "hric_msgs/msg/ControlLog in the bag has no field 'n_cycles'" in capsys.readouterr().err


def test_a_run_whose_bag_is_a_folder_is_exported(exported: Path, tmp_path: Path) -> None:
    shutil.copytree(exported / "mcap", tmp_path / "run/bag")
    (tmp_path / "run/run.yaml").write_text("bag: bag")
    assert main(["export", str(tmp_path / "run"), "--format", "csv", "--topics", "/joint_states"]) == 0
    assert (tmp_path / "run/export/csv/joint_states.csv").is_file()
