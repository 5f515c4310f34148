"""The pages against the running system: nothing undocumented, nothing documented that is not there."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import rosgraph
import rosservice
import rostopic
from live_system import LiveSystem

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from interface_pages import Row, pages, rows

STANDARD_TOPICS = {"/rosout", "/rosout_agg", "/tf", "/tf_static", "/clock", "/diagnostics"}
STANDARD_SERVICES = ("/get_loggers", "/set_logger_level")
ACTION_PARTS = ("/goal", "/cancel", "/status", "/feedback", "/result")
TESTER = "/integration_tests"
OWN_LAUNCH_FILE = {"hric_perception", "mocap_natnet"}
"""Packages that the default bring-up does not start."""


def documented(section: str) -> list[Row]:
    return [row for page in pages() for row in rows(page) if row.section == section]


@pytest.fixture(scope="module")
def graph(live: LiveSystem) -> tuple[dict[str, list[str]], dict[str, list[str]], list[str]]:
    """Topics with publishers and with subscribers, and services, but for those of this process and of short-lived tools."""
    publishers, subscribers, services = rosgraph.Master("/pages").getSystemState()

    def own(nodes: list[str]) -> list[str]:
        return [node for node in nodes if node != TESTER and not node.startswith(("/rosout", "/rostopic", "/recorder_", "/spawner_", "/unspawner_"))]

    kept = [{topic: own(nodes) for topic, nodes in side if own(nodes)} for side in (publishers, subscribers)]
    return kept[0], kept[1], [name for name, nodes in services if own(nodes)]


def test_every_topic_of_the_running_system_is_documented(graph) -> None:
    publishers, subscribers, _ = graph
    topics, actions = documented("Topics"), documented("Actions")
    unknown = []
    for direction, side in (("pub", publishers), ("sub", subscribers)):
        for topic in side:
            if topic in STANDARD_TOPICS or any(row.cells["direction"] == direction and row.matches(topic) for row in topics):
                continue
            part = next((part for part in ACTION_PARTS if topic.endswith(part)), None)
            if part and any(row.matches(topic.removesuffix(part)) for row in actions):
                continue
            # A topic that one of our nodes offers may be heard by another without a row of its own.
            if direction == "sub" and any(row.matches(topic) for row in topics):
                continue
            unknown.append((direction, topic, side[topic]))
    assert unknown == []


def test_every_service_of_the_running_system_is_documented(graph) -> None:
    services = documented("Services")
    assert [name for name in graph[2] if not name.endswith(STANDARD_SERVICES) and not any(row.matches(name) for row in services)] == []


def test_the_types_on_the_wire_are_those_of_the_pages(graph) -> None:
    wrong = []
    for row in documented("Topics"):
        for topic in graph[0]:
            if row.matches(topic) and rostopic.get_topic_type(topic)[0] != row.cells["type"]:
                wrong.append((topic, rostopic.get_topic_type(topic)[0], row.cells["type"]))
    for row in documented("Services"):
        for service in graph[2]:
            if row.matches(service) and rosservice.get_service_type(service) != row.cells["type"]:
                wrong.append((service, rosservice.get_service_type(service), row.cells["type"]))
    assert wrong == []


def of_the_bring_up(section: str) -> list[Row]:
    """Rows but for those of packages that are started by themselves, and for the other ends of these."""
    elsewhere = [row for row in documented(section) if row.page.parent.name in OWN_LAUNCH_FILE]
    return [row for row in documented(section) if row not in elsewhere and not any(other.matches(row.name) for other in elsewhere)]


def test_everything_documented_for_the_default_bring_up_is_there(live: LiveSystem, graph) -> None:
    publishers, subscribers, _ = graph
    published = set(publishers) | {topic for topic, _ in rosgraph.Master("/pages").getPublishedTopics("")}
    services = [name for name, _ in rosgraph.Master("/pages").getSystemState()[2]]
    sides = {"pub": published, "sub": set(subscribers)}
    absent = []
    for row in of_the_bring_up("Topics"):
        # One end may be an experiment's node or the user's hand, which a plain bring-up lacks: then the documented other end must be there.
        directions = {other.cells["direction"] for other in documented("Topics") if row.matches(other.name) or other.matches(row.name)}
        if not any(row.matches(topic) for direction in directions for topic in sides[direction]):
            absent.append((row.page.parent.name, row.cells["direction"], row.name))
    absent += [(row.page.parent.name, "service", row.name) for row in of_the_bring_up("Services") if not any(row.matches(name) for name in services)]
    absent += [
        (row.page.parent.name, "action", row.name)
        for row in documented("Actions")
        if not any(row.matches(t.removesuffix("/status")) for t in publishers)
    ]
    assert absent == []
