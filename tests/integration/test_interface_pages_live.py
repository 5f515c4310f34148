"""Comparison of the INTERFACE.md pages with running systems: every name is documented, every documented name exists."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from unittest import mock

import pytest
import rosgraph
import rosservice
import yaml
from live_system import READY_TIMEOUT, ROOT, LiveSystem, wait_for

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from interface_pages import Row, pages, rows

pytestmark = pytest.mark.alone
STANDARD_TOPICS = {"/rosout", "/rosout_agg", "/tf", "/tf_static", "/clock", "/diagnostics"}
STANDARD_SERVICES = ("/get_loggers", "/set_logger_level", "/tf2_frames")
ACTION_PARTS = ("/goal", "/cancel", "/status", "/feedback", "/result")
NOT_OF_THE_SYSTEM = ("/integration_tests", "/rosout", "/rostopic", "/recorder_", "/spawner_", "/unspawner_")
"""Prefixes of the names of this process and of short-lived tools."""
SENSORS = {"hric_human", "hric_perception", "mocap_natnet"}
"""Packages that the default bring-up does not start."""
OPTIONAL = {"policy_controller/goal", "policy_controller/state"}
"""Topics of a controller that needs an optional part of the set-up (tests/contract/test_policy.py)."""
NOT_AT_ONCE = {"<body>/ground_pose", "hric/human/root"}
"""Topics that cannot exist together with others.

`natnet_client` publishes one set of topic names at a time (mocap_natnet/test/test_publisher.py); a walking human is not
measured by emulated motion capture (hric_experiments/test/test_walk.py).
"""
EXPERIMENT = ROOT / "src/hric_experiments/config/experiments/data_collection.yaml"


@cache
def documented(section: str) -> list[Row]:
    return [row for page in pages() for row in rows(page) if row.section == section]


@dataclass(frozen=True)
class Graph:
    """Names in use on a master, without those of this process and of short-lived tools.

    Attributes:
        publishers, subscribers: topic -> nodes.
        services: service -> type.
        types: topic -> type.
        offered: topics and services of all nodes.
    """

    publishers: dict[str, list[str]]
    subscribers: dict[str, list[str]]
    services: dict[str, str]
    types: dict[str, str]
    offered: frozenset[str]

    @classmethod
    def of(cls, uri: str) -> "Graph":
        """Read the current names."""
        with mock.patch.dict(os.environ, ROS_MASTER_URI=uri):
            master = rosgraph.Master("/pages")
            sides = master.getSystemState()
            own = [
                {
                    name: kept
                    for name, nodes in side
                    if (kept := [node for node in nodes if not node.startswith(NOT_OF_THE_SYSTEM)])
                }
                for side in sides
            ]
            types = {name: rosservice.get_service_type(name) for name in own[2] if not name.endswith(STANDARD_SERVICES)}
            offered = frozenset(name for side in (sides[0], sides[2]) for name, _ in side)
            return cls(own[0], own[1], types, dict(master.getTopicTypes()), offered)


def a_long_collection(folder: Path) -> Path:
    """Arguments of a data collection with sources that subscribe to topics.

    Activation comes from a human with muscles in the robot's plant, measured by motion capture, and the load from
    contacts.
    """
    content = yaml.safe_load(EXPERIMENT.read_text()) | {"duration": 3600.0, "setpoints": []}
    content["emg"]["emulated"]["activation"] = {"program": "topic"}
    content["human"] = {
        "position": [0.9, -0.4],
        "drive": "muscle",
        "grips": {"guide": {"held": "panda_hand", "close": {"by_service": True}}},
    }
    content["mocap"]["human"] = {"program": "body"}
    content["force_plate"]["emulated"]["load"] = {"program": "contacts", "body": "plate"}
    path = folder / "long_collection.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.fixture(scope="module")
def sensors(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveSystem]:
    """Data collection with further nodes of these packages.

    These are a synchroniser with a fixed rate, the calibration, an emulated Motive that follows a link, and the
    joint angles
    of a real person.
    """
    folder = tmp_path_factory.mktemp("sensors")
    (folder / "scene.yaml").write_text(
        "bodies: [{name: tool, motion: {type: link, link: panda_link8, frame: panda_link0}}]\n"
    )
    source = {"topic": "/joint_states", "type": "sensor_msgs/JointState", "signals": ["position[0]"]}
    plan = json.dumps({"rate": 10, "sources": [source]})
    with ExitStack() as stack:
        system = LiveSystem(
            folder, "env:=sim", "rviz:=false", "view:=true", f"experiment:={a_long_collection(folder)}",
            "mocap_server:=127.0.7.14", "real_time_factor:=0.25"
        )  # fmt: skip
        stack.callback(system.close)
        system.wait_running("joint_pd_controller")
        for command in (
            ("hric_perception", "synchronizer", "__name:=single", f"_plan:={plan}"),
            ("mocap_natnet", "calibrate"),
            ("hric_perception", "person"),
            (
                "mocap_natnet",
                "emulated_motive",
                "--scene",
                str(folder / "scene.yaml"),
                "--ip",
                "127.0.7.15",
                "--transport",
                "unicast",
            ),
        ):
            stack.enter_context(system.started("rosrun", *command))
        yield system


def of_the_sensors(section: str) -> list[Row]:
    return [row for row in documented(section) if row.page.parent.name in SENSORS and row.name not in NOT_AT_ONCE]


def of_the_bring_up(section: str) -> list[Row]:
    """Return the documented rows, without packages that are started separately and without their counterparts."""
    elsewhere = [row for row in documented(section) if row.page.parent.name in SENSORS or row.name in OPTIONAL]
    return [
        row
        for row in documented(section)
        if row not in elsewhere and not any(other.matches(row.name) for other in elsewhere)
    ]


def absent(graph: Graph, wanted: list[Row]) -> list[tuple[str, str, str]]:
    """Return package, kind and name of the rows that are missing in the running system."""
    sides = {"pub": graph.offered, "sub": frozenset(graph.subscribers)}
    found = []
    for row in wanted:
        if row.section == "Topics":
            # One end may be an experiment's node or the user's hand: then the documented other end must be there.
            ends = {
                other.cells["direction"]
                for other in documented("Topics")
                if row.matches(other.name) or other.matches(row.name)
            }
            there = any(row.matches(name) for end in ends for name in sides[end])
        elif row.section == "Services":
            there = any(row.matches(name) for name in graph.offered)
        else:
            there = any(row.matches(name.removesuffix("/status")) for name in graph.publishers)
        if not there:
            found.append((row.page.parent.name, row.section, row.name))
    return found


def test_everything_documented_for_the_default_bring_up_is_there(live: LiveSystem) -> None:
    wanted = of_the_bring_up("Topics") + of_the_bring_up("Services") + documented("Actions")
    assert absent(Graph.of(live.uri), wanted) == []


def test_everything_documented_of_motion_capture_and_sensors_is_there(sensors: LiveSystem) -> None:
    wanted = of_the_sensors("Topics") + of_the_sensors("Services")
    with suppress(AssertionError):
        wait_for(lambda: not absent(Graph.of(sensors.uri), wanted), READY_TIMEOUT, "all is there")
    assert absent(Graph.of(sensors.uri), wanted) == []


@pytest.fixture(params=["live", "sensors"])
def graph(request: pytest.FixtureRequest) -> Graph:
    """Names in use in the default bring-up, and in the bring-up with sensors."""
    return Graph.of(request.getfixturevalue(request.param).uri)


def test_every_topic_of_the_running_system_is_documented(graph: Graph) -> None:
    topics, actions = documented("Topics"), documented("Actions")
    unknown = []
    for direction, side in (("pub", graph.publishers), ("sub", graph.subscribers)):
        for topic in side:
            if topic in STANDARD_TOPICS or any(
                row.cells["direction"] == direction and row.matches(topic) for row in topics
            ):
                continue
            part = next((part for part in ACTION_PARTS if topic.endswith(part)), None)
            if part and any(row.matches(topic.removesuffix(part)) for row in actions):
                continue
            # A node may subscribe to a topic of another documented node without a separate row.
            if direction == "sub" and any(row.matches(topic) for row in topics):
                continue
            unknown.append((direction, topic, side[topic]))
    assert unknown == []


def test_every_service_of_the_running_system_is_documented(graph: Graph) -> None:
    services = documented("Services")
    assert [name for name in graph.services if not any(row.matches(name) for row in services)] == []


def test_the_types_on_the_wire_are_those_of_the_pages(graph: Graph) -> None:
    wrong = []
    for section, types in (
        ("Topics", {name: graph.types[name] for name in graph.publishers}),
        ("Services", graph.services),
    ):
        for row in documented(section):
            wrong += [
                (name, kind, row.cells["type"])
                for name, kind in types.items()
                if row.matches(name) and kind != row.cells["type"]
            ]
    assert wrong == []
