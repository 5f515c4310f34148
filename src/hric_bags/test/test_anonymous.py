"""Anonymised exports: all files are searched for anything that identifies the person or the date."""

import json
import re
import struct
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import export_bags
import ezc3d
import numpy as np
import pyarrow.parquet
import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from rosgraph_msgs.msg import Log
from std_msgs.msg import String

from hric_bags.export import exporting, recording
from hric_bags.export.anonymous import STAYS, Anonymiser
from hric_bags.export.job import FORMATS, ExportRequest
from hric_bags.export.recording import ExportSource
from hric_bags.memory import FIRST
from hric_bags.run_folder import RunFolder
from hric_core.command import perform
from hric_core.errors import HricError
from hric_core.robot_time.stamps import to_time
from hric_msgs.msg import HumanEvent, JointTorque
from hric_run.bag_writer import BagWriter

RAW = "/hric/perception/emg/raw"
WALL = 1_773_480_000
"""Date of the run: 2026-03-14 09:20:00 UTC, as seconds since 1970 [s]."""
STRENGTH = 0.35170923
BODY = {
    "mass": 83.719531,
    "height": 1.873492,
    "sex": "female",
    "dominant_hand": "left",
    "lengths": {"upper_arm": 0.33310417},
}
HUMAN = {
    "subject": {"code": "S07", **BODY, "parts": "both_arms"},
    "muscles": {"strength": 0.81290731},
    "position": [0.7, 0.0],
}
BLOW = {"human_mass": 2.22271905, "mass": 1.11170342, "ratio": 0.99910023, "peak": 12.0}
RUN = {
    "experiment": "reach",
    "description": "Jane Doe reaches, 14.3.",
    "started": "2026-03-14T09:20:00Z",
    "finished": "2026-03-14T09:21:00Z",
    "arguments": ["human.subject.mass:=83.719531", "kp:=200", "person.subject:=S07.yaml"],
    "definition": {"human": HUMAN, "person": {"subject": "people/S07.yaml", "calibration": "S07_still.yaml"}},
    "parameters": {"robot": {"participants": {"human": {"type": "hric_human/Human", **HUMAN}}}},
    "revision": {"commit": "abc"},
}
METRICS = {
    "experiment": "reach",
    "human": {
        "subject": "S07",
        "joints": {"r_elbow": {"torque_max": 4.5, "share_max": STRENGTH, "share_mean": 0.1, "clipped": 0}},
        "strength_share_max": STRENGTH,
        "contacts": [{"peak": 12.5, "transient": BLOW}],
    },
    "control_log": {"cycles": 400},
}
TOLD = (
    *(
        "S07",
        "Jane",
        "Doe",
        "83.719531",
        "1.873492",
        "female",
        "0.33310417",
        "0.81290731",
        str(STRENGTH),
        "2.22271905",
        "1.11170342",
    ),
    *("2026-03-14", "20260314", "09:20", "1773480", "S07_still", "lab-pc"),
)
"""Texts that must not be in any exported file."""
NUMBERS = (83.719531, 1.873492, 0.33310417, 0.81290731, STRENGTH, 2.22271905, 1.11170342)
"""Numbers that must not be in any file as 8-byte floats (4-byte floats may occur by chance)."""


def times_later(value: Any) -> Any:
    """A message of rosbags whose times are on the wall clock, and whose marked body has the code of the person."""
    if isinstance(value, str):
        return re.sub(r"\bhand\b", "S07", value)
    if isinstance(value, list):
        return [times_later(item) for item in value]
    if not is_dataclass(value) or isinstance(value, type):
        return value
    if hasattr(value, "sec") and hasattr(value, "nanosec"):
        return replace(value, sec=int(value.sec) + WALL)
    names = [field.name for field in fields(value) if field.init and field.name != "__msgtype__"]
    return replace(value, **{name: times_later(getattr(value, name)) for name in names})


def write_own(path: Path) -> None:
    """Write a bag with messages that identify the person, in addition to those of other export tests."""
    with BagWriter(path) as bag:
        bag.write("/rosout", Log(name="/driver", msg="Jane Doe on lab-pc"), 0.01)
        torque = JointTorque(name=["r_elbow"], torque=[4.5], strength_share=[STRENGTH], at_strength=[True], clipped=[3])
        event = HumanEvent(kind="started", text="S07 began at 2026-03-14T09:20:01Z")
        for k in range(20):
            torque.header.stamp = event.header.stamp = to_time(0.01 * k)
            bag.write("/hric/human/joint_torque", torque, 0.01 * k)
            bag.write("/hric/human/events", event, 0.01 * k)
        bag.write("/S07/note", String(data="S07 is tired"), 0.02)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Write the run of a person, recorded on the wall clock, in a folder with the date."""
    made = tmp_path_factory.mktemp("made")
    export_bags.write(made / "usual.bag", mocap_frame="base")
    write_own(made / "own.bag")
    folder = RunFolder(made / "runs" / "reach_20260314-092000")
    folder.path.mkdir(parents=True)
    with Writer(folder.bag_path) as writer:
        for source in ("usual", "own"):
            with AnyReader([made / f"{source}.bag"]) as reader:
                for c in reader.connections:
                    callerid = f"/{source}_4711_1773480000123"
                    target = writer.add_connection(
                        c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest, callerid=callerid, latching=0
                    )
                    for _, time, raw in reader.messages([c]):
                        message = times_later(reader.deserialize(raw, c.msgtype))
                        data = reader.typestore.serialize_ros1(message, c.msgtype)
                        writer.write(target, (0 if time == FIRST else time) + WALL * 10**9, data)
    folder.write({**RUN, "bag": folder.bag_path.name})
    folder.metrics_path.write_text(json.dumps(METRICS))
    return folder


@pytest.fixture(scope="module")
def exported(run: RunFolder) -> tuple[Path, exporting.ExportResult]:
    source = recording.find(str(run.path))
    request = ExportRequest(FORMATS, load_body="hand", anonymise=("Jane Doe", "Jane", "Doe"))
    result = exporting.export(source, request)
    assert not result.failures, result.failures
    return run.path / "anonymised", result


def contents(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield (name, bytes) of each file, of compressed files also uncompressed."""
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            yield str(path.relative_to(folder)), path.read_bytes()
            if path.suffix == ".parquet":
                table = pyarrow.parquet.read_table(path)
                yield f"{path.name}, read", (str(table.schema) + str(table.to_pydict())).encode()
                yield f"{path.name}, metadata", str(table.schema.metadata).encode()


def test_the_originals_are_in_the_run_so_that_the_search_would_find_them(run: RunFolder) -> None:
    everything = b"".join(path.read_bytes() for path in run.path.glob("*") if path.is_file())
    for word in ("S07", "Jane", "83.719531", "female", "2026-03-14", "4711", "lab-pc"):
        assert word.encode() in everything, word
    assert struct.pack("<d", STRENGTH) in everything


def test_no_file_has_the_original_values(exported: tuple[Path, exporting.ExportResult]) -> None:
    folder, result = exported
    assert set(result.files) == set(FORMATS)
    count = 0
    for name, data in contents(folder):
        count += 1
        for word in TOLD:
            assert word not in name, name
            assert word.encode() not in data, f"{word} in {name}"
            assert word.encode("utf-16-le") not in data and word.encode("utf-32-le") not in data, f"{word} in {name}"
        for number in NUMBERS:
            assert struct.pack("<d", number) not in data, f"{number} in {name}"
    assert count > 20


def test_no_time_in_any_format_is_a_date(exported: tuple[Path, exporting.ExportResult]) -> None:
    folder, _ = exported
    for path in folder.rglob("*.npz"):
        with np.load(path) as arrays:
            assert "stamp" in arrays
            for name in arrays.files:
                values = arrays[name]
                if values.dtype.kind in "fi":
                    assert not np.any(np.abs(values - WALL) < 1e6), f"{path.name}: {name}"
                    assert not np.any(np.abs(values - WALL * 1e9) < 1e15), f"{path.name}: {name}"
    (bag,) = folder.rglob("*.bag")
    with AnyReader([bag]) as reader:
        assert reader.message_count > 100 and reader.end_time < 10 * 10**9
        assert not {c.topic for c in reader.connections} & {"/rosout", "/S07/note"}
        assert all("4711" not in c.ext.callerid for c in reader.connections)
        for connection, _, raw in reader.messages():
            header = getattr(reader.deserialize(raw, connection.msgtype), "header", None)
            assert header is None or header.stamp.sec < 10, connection.topic


def test_the_parameters_of_the_c3d_file_have_no_date(exported: tuple[Path, exporting.ExportResult]) -> None:
    (path,) = exported[0].rglob("*.c3d")
    file = ezc3d.c3d(str(path))
    assert path.name == "recording.c3d" and "STARTED" not in file["parameters"]["HRIC"]
    assert abs(file["parameters"]["HRIC"]["START_TIME"]["value"][0]) < 10.0


def test_times_keep_their_distances(run: RunFolder, exported: tuple[Path, exporting.ExportResult]) -> None:
    before = recording.read(recording.find(str(run.path)), [RAW])[RAW].stamp
    with np.load(exported[0] / "npz" / "hric.perception.emg.raw.npz") as arrays:
        assert np.array_equal(np.diff(arrays["stamp"]), np.diff(before)) and arrays["stamp"][0] >= 0


def test_what_is_left_of_the_run_is_coarse(exported: tuple[Path, exporting.ExportResult]) -> None:
    run = yaml.safe_load((exported[0] / "about" / "run.yaml").read_text())
    human = run["definition"]["human"]
    assert human["subject"] == {"parts": "both_arms", "mass": 80.0, "height": 1.9}
    assert human["position"] == [0.7, 0.0] and "strength" not in human["muscles"]
    assert run["arguments"] == ["kp:=200"] and run["revision"] == {"commit": "abc"}
    metrics = json.loads((exported[0] / "about" / "metrics.json").read_text())
    assert metrics["human"]["joints"] == {"r_elbow": {"torque_max": 4.5}}
    assert metrics["human"]["contacts"] == [{"peak": 12.5, "transient": {"peak": 12.0}}]
    assert metrics["control_log"] == {"cycles": 400}


def test_what_was_dropped_coarsened_and_left_is_listed(exported: tuple[Path, exporting.ExportResult]) -> None:
    folder, result = exported
    said = (folder / "about" / "anonymised.txt").read_text()
    for part in ("dates of the run", "mass of the subject: rounded to 10 kg", "height of the subject", STAYS):
        assert part in said and any(part in note for note in result.notes)


def test_an_export_that_goes_on_still_lists_all_of_it(
    run: RunFolder, exported: tuple[Path, exporting.ExportResult]
) -> None:
    before = (exported[0] / "about" / "anonymised.txt").read_text()
    request = ExportRequest(FORMATS, load_body="hand", anonymise=("Jane Doe", "Jane", "Doe"))
    again = exporting.export(recording.find(str(run.path)), request)
    assert not again.seconds and (exported[0] / "about" / "anonymised.txt").read_text() == before


def test_it_does_not_go_into_a_folder_with_the_person(run: RunFolder, tmp_path: Path) -> None:
    source = recording.find(str(run.path))
    exporting.export(source, ExportRequest(("csv",), (RAW,)), tmp_path)
    with pytest.raises(HricError, match="not anonymised; valid: another folder"):
        exporting.export(source, ExportRequest(("csv",), (RAW,), anonymise=()), tmp_path)


def test_a_bag_by_itself_needs_a_folder_whose_name_its_user_chooses(run: RunFolder, tmp_path: Path) -> None:
    words = ["--format", "csv", "--topics", RAW, "--quiet", "--anonymise"]
    with pytest.raises(HricError, match="needs --output DIR"):
        perform(["export", str(run.bag_path), *words])
    assert perform(["export", str(run.bag_path), "--output", str(tmp_path / "out"), *words]) == 0
    assert {path.name for path in (tmp_path / "out").rglob("*")} >= {"hric.perception.emg.raw.csv", "anonymised.txt"}


class CountedBag:
    """Return definitions and messages of a bag, and how many messages were decoded."""

    def __init__(self, store: Typestore) -> None:
        self.typestore, self.decoded = store, 0

    def deserialize(self, raw: bytes, kind: str) -> Any:
        self.decoded += 1
        return self.typestore.deserialize_ros1(raw, kind)


def decoded_each(bag: Any, anonymiser: Anonymiser, kind: str, raw: bytes) -> bytes:
    message = anonymiser.message(bag.typestore.deserialize_ros1(raw, kind))
    return bytes(bag.typestore.serialize_ros1(message, kind))


def test_messages_of_texts_and_lengths_that_came_before_are_not_decoded_and_look_as_if_they_were(
    run: RunFolder,
) -> None:
    first, second = (Anonymiser(RUN, METRICS, ("Jane",), WALL * 10**9) for _ in range(2))
    count = 0
    with recording.open_reader(recording.find(str(run.path))) as reader:
        bag: Any = CountedBag(reader.typestore)
        for connection, _, raw in reader.chosen(lambda c: not first.hides(c.msgtype) | second.hides(c.msgtype)):
            kind, count = connection.msgtype, count + 1
            assert first.serialised(bag, connection, raw) == decoded_each(bag, second, kind, raw), kind
    assert first.done == second.done
    assert bag.decoded < count / 2


def test_dates_anywhere_in_a_message_are_counted_also_where_its_texts_and_lengths_came_before() -> None:
    store, kind, random = get_typestore(Stores.EMPTY), "hric_msgs/msg/Made", np.random.default_rng(1)
    fields_of = "time[] stamps\nduration wait\nfloat64 a\nfloat32 b\nint64 c\nuint64 d\nfloat64[] e\nfloat64[2] f\n"
    fields_of += "float32[] g\nchar h\nbool i\nuint8[] j\nfloat64[] strength\nstring name\nstring[] text\n"
    store.register(get_types_from_msg(fields_of, kind))
    made, time, duration = (
        store.types[name] for name in (kind, "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
    )
    first, second = (Anonymiser({}, {}, (), WALL * 10**9) for _ in range(2))
    bag: Any = CountedBag(store)
    connection: Any = SimpleNamespace(topic="/made", msgtype=kind)

    def number(date: float, among: int = 100) -> float:
        return date if random.integers(among) == 0 else float(random.normal(scale=10.0 ** random.integers(-3, 9)))

    for _ in range(2000):
        message = made(
            stamps=[time(sec=int(random.choice([3, WALL + 3])), nanosec=7) for _ in range(random.integers(3))],
            wait=duration(sec=-2, nanosec=5),
            **{"a": number(WALL + 0.5), "b": number(WALL), "c": int(number(WALL * 10**9)), "h": 5, "i": True},
            d=abs(int(number(WALL * 10**9))),
            e=np.array([number(WALL + 1.0) for _ in range(3)]),
            f=np.array([number(4e9), number(1e9)]),
            g=np.full(2, WALL, np.float32),
            j=np.zeros(2, np.uint8),
            strength=np.full(random.integers(2), random.integers(2), float),
            **{"name": str(random.choice(["hand", "Jane"])), "text": ["Jane"]},
        )
        raw = bytes(store.serialize_ros1(message, kind))
        cleaned = first.serialised(bag, connection, raw)
        assert cleaned == decoded_each(bag, second, kind, raw)
        assert max((stamp.sec for stamp in store.deserialize_ros1(cleaned, kind).stamps), default=0) <= 3
    assert bag.decoded < 1500


def test_times_that_are_no_dates_stay() -> None:
    anonymiser = Anonymiser({}, {}, (), 0)
    assert [anonymiser.time(t) for t in (0, 5 * 10**9)] == [0, 5 * 10**9] and anonymiser.done == [STAYS]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("S07", "name_1"),
        ("human::S07_hand", "human::name_1"),
        ("/S07/joint_states", "/name_1/joint_states"),
        ("panda_joint7", "panda_joint7"),
        ("right_sh_flex", "right_sh_flex"),
        ("run_20260102", "name_1"),
        ("run_12_11_26", "name_1"),
        ("/robot_4711_1773480000123", "/robot"),
        ("joint_torque velocity_20", "joint_torque velocity_20"),
        ("N m", "N m"),
        ("torque " * 20, "name_1"),
        ("", ""),
    ],
)
def test_names_have_public_words_or_a_number(text: str, wanted: str) -> None:
    assert Anonymiser({}, {}, (), 0).name(text) == wanted


def test_a_public_word_that_names_the_person_is_none() -> None:
    anonymiser = Anonymiser({"subject": "hand1"}, {}, ("Force",), 0)
    assert [anonymiser.name(text) for text in ("hand", "force", "torque")] == ["name_1", "name_2", "torque"]


def test_the_source_stays_as_it_is(run: RunFolder) -> None:
    assert isinstance(recording.find(str(run.path)), ExportSource) and yaml.safe_load(
        (run.path / "run.yaml").read_text()
    )["definition"]["human"]["subject"]["mass"] == pytest.approx(83.719531)
