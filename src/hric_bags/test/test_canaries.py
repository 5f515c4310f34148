"""Unique texts (canaries) in all files and messages of a run: none is in an anonymised export."""

import importlib
import json
import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import genpy
import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from test_anonymous import contents

from hric_bags.export import exporting, recording
from hric_bags.export.anonymous import privacy
from hric_bags.export.job import FORMATS, ExportRequest
from hric_bags.run_folder import RunFolder
from hric_core.parameters import read_yaml
from hric_msgs.msg import ControlLog
from hric_run.bag_writer import BagWriter
from hric_run.definition import experiment

CANARY = "Kanarienvogel"
"""Begin of each canary."""
WALL = 1_773_480_000
"""Date of the run: 2026-03-14 09:20:00 UTC, as seconds since 1970 [s]."""
PRIVATE_NUMBER = 83.719531
OTHERS = ("std_msgs", "sensor_msgs", "diagnostic_msgs", "visualization_msgs", "rosgraph_msgs", "tf2_msgs")


class Canaries:
    """Generator of unique texts, which counts them."""

    def __init__(self) -> None:
        self.count = 0

    def new(self) -> str:
        self.count += 1
        return f"{CANARY}{self.count}"

    def everywhere(self, value: Any) -> Any:
        """Return data with a canary for each text, and unknown keys in each mapping; times become dates."""
        if isinstance(value, Mapping):
            known = {key: self.everywhere(item) for key, item in value.items()}
            return {**known, self.new(): PRIVATE_NUMBER, f"note_{self.new()}": self.new(), "notes": self.new()}
        if isinstance(value, list):
            return [self.everywhere(item) for item in value]
        return self.new() if isinstance(value, str) else value

    def message(self, kind: type) -> Any:
        """Return a message with a canary in each text, two elements in each array, and dates as times."""
        made = kind()
        for name, typed in zip(made.__slots__, made._slot_types, strict=True):
            setattr(made, name, self.field(typed))
        if kind is ControlLog:
            made.time = made.time[: made.n_cycles]
        return made

    def field(self, typed: str) -> Any:
        base, _, size = typed.partition("[")
        if size and base in ("uint8", "char"):
            return (CANARY.encode() * 9)[: int(size[:-1])] if size != "]" else self.new().encode()
        if size:
            return [self.field(base) for _ in range(2 if size == "]" else int(size[:-1]))]
        if base == "string":
            return self.new()
        if base in ("time", "duration"):
            return genpy.Time(WALL, 5) if base == "time" else genpy.Duration(0, 5)
        if base == "float64":
            return WALL + 0.5
        if re.fullmatch(r"bool|byte|char|float32|u?int\d+", base):
            return 1
        return self.message(genpy.message.get_message_class("std_msgs/Header" if base == "Header" else base))


def messages() -> Iterator[type]:
    """Return all message types of packages that an export passes on, and of others."""
    for package in (*sorted(privacy().packages), *OTHERS):
        module = importlib.import_module(f"{package}.msg")
        yield from (kind for kind in vars(module).values() if isinstance(kind, type) and hasattr(kind, "_slot_types"))


@pytest.fixture(scope="module")
def canaries() -> Canaries:
    return Canaries()


@pytest.fixture(scope="module")
def exported(canaries: Canaries, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the export of a run that is full of canaries."""
    folder = RunFolder(tmp_path_factory.mktemp("runs") / f"{canaries.new()}_20260314-092000")
    folder.path.mkdir()
    with BagWriter(folder.bag_path) as bag:
        for kind in messages():
            for k in range(2):
                bag.write(f"/{canaries.new() if k else 'hric'}/{kind._type}", canaries.message(kind), WALL + 0.1 * k)
    head = {
        "experiment": "", "status": "completed", "mode": "", "started": "", "finished": "", "subject": "", "notes": "",
        "reason": "", "error": "", "arguments": ["", "", "human.subject.mass:=83.7"], "interval": [WALL, WALL + 1.0],
        "versions": {"python": "", "numpy": ""}, "revision": {"commit": ""}, "platform": {"system": "", "machine": ""},
        "state_sha256": "", "limits": {"panda_joint1": {"lower": -1.0}}, "seed": 20260314,
    }  # fmt: skip
    definitions = {name: experiment.read(name) for name in experiment.names()}
    run = canaries.everywhere({**head, "definition": definitions["co_transport"], "parameters": definitions})
    folder.write({**run, "bag": folder.bag_path.name})
    metrics = {
        "experiment": "",
        "joints": {"": {"effort_peak": 1.0}},
        "topics": {"": 2},
        "stability": {"reasons": [""]},
    }
    folder.metrics_path.write_text(json.dumps(canaries.everywhere(metrics)))
    link = f'<link name="{canaries.new()}"><visual><geometry><mesh filename="/home/{canaries.new()}/a.stl"/></geometry>'
    folder.urdf_path.write_text(f'<robot name="{canaries.new()}">{link}</visual></link></robot>')
    result = exporting.export(recording.find(str(folder.path)), ExportRequest(FORMATS, anonymise=()))
    assert {"npz", "csv", "parquet", "bag"} <= set(result.files), result.failures
    return folder.path / "anonymised"


def test_no_canary_comes_out(canaries: Canaries, exported: Path) -> None:
    assert canaries.count > 2000
    count = 0
    for name, data in contents(exported):
        count += 1
        assert CANARY.lower() not in name.lower(), name
        for found in (data, data.replace(b"\0", b"")):  # also of two or four bytes a letter
            assert CANARY.lower().encode() not in found.lower(), (name, re.findall(rb".{40}Kanarien.{10}", found)[:1])
        assert struct.pack("<d", PRIVATE_NUMBER) not in data and b"83.71" not in data, name
        assert b"20260314" not in data and b"2026-03" not in data and b"17734800" not in data, name
    assert count > 200


def test_what_is_known_is_passed_on(exported: Path) -> None:
    run = yaml.safe_load((exported / "about" / "run.yaml").read_text())
    assert run["interval"] == [0.0, 1.0] and run["limits"] == {"panda_joint1": {"lower": -1.0}}
    assert run["parameters"]["pd_step"]["duration"] == experiment.read("pd_step")["duration"]
    (bag,) = exported.rglob("*.bag")
    with AnyReader([bag]) as reader:
        kinds = {connection.msgtype for connection in reader.connections}
        assert {"hric_msgs/msg/ControlLog", "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"} <= kinds
        assert not {"std_msgs/msg/String", "sensor_msgs/msg/Image", "rosgraph_msgs/msg/Log"} & kinds
        assert (reader.end_time - reader.start_time) // 10**8 == 1
        (states, *_) = (c for c in reader.connections if c.topic == "/hric/sensor_msgs/JointState")
        message: Any = reader.deserialize(next(raw for _, _, raw in reader.messages([states])), states.msgtype)
    assert message.name[0] != message.name[1] and all(re.fullmatch(r"name_\d+", name) for name in message.name)
    assert np.allclose(message.position, 0.5) and message.header.stamp.sec == 0


def test_every_key_of_the_projects_own_files_has_a_class() -> None:
    """A new message type or key needs a class in config/privacy.yaml: public words, or private."""
    known = privacy()

    def unknown(value: Any, path: tuple[str, ...]) -> Iterator[str]:
        for key, item in value.items() if isinstance(value, Mapping) else ():
            words = re.findall(r"[A-Za-z]+", str(key))
            if key not in known.private and not all(word.lower() in known.public for word in words):
                yield "/".join((*path, str(key)))
            elif key not in known.private:
                yield from unknown(item, (*path, str(key)))

    files = [path for name in experiment.names() if (path := experiment.find(name))]
    assert [text for path in files for text in unknown(read_yaml(path), (path.stem,))] == []
    for kind in messages():
        if kind._type.split("/")[0] in known.packages:
            for name in kind.__slots__:
                words = re.findall(r"[a-z]+", name.lower())
                assert all(word in known.public for word in words), f"{kind._type}: {name}"
