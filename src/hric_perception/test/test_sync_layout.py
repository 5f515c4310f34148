"""From YAML and messages to stamps and values."""

import math
from typing import Any

import genpy
import numpy as np
import pytest
from geometry_msgs.msg import Point, PoseStamped, WrenchStamped
from sensor_msgs.msg import JointState

from franka_msgs.msg import FrankaState
from hric_core.errors import HricError
from hric_msgs.msg import ControlLog, MocapData, RigidBodyState, SampleChunk
from hric_perception.sync.core import Synchroniser
from hric_perception.sync.layout import read_plan


def plan(kind: str, *signals: Any, **settings: Any) -> Any:
    return read_plan("sync", {"sources": [{"topic": "/t", "type": kind, "signals": list(signals)}], **settings})


def taken(kind: str, signals: list[Any], message: Any) -> tuple[list[int], list[list[float]]]:
    message.header.stamp = message.header.stamp or genpy.Time(5, 7)
    synchroniser = Synchroniser(plan(kind, *signals), 0.0)
    synchroniser.push_message(0, message, 0.0)
    synchroniser.take(0.0)
    buffer = synchroniser.intakes[0].buffer
    return buffer.stamps.tolist(), buffer.values.tolist()


def test_joints_are_found_by_name_in_any_order_and_followed_when_it_changes() -> None:
    synchroniser = Synchroniser(plan("sensor_msgs/JointState", "position[b, a]", "velocity[a]"), 0.0)
    for second, (names, position) in enumerate(
        ((["a", "b"], [1.0, 2.0]), (["x", "b", "a"], [9.0, 2.0, 1.0]), (["finger"], [0.04]))
    ):
        message = JointState(name=names, position=position, velocity=position)
        message.header.stamp = genpy.Time(1, second)
        synchroniser.push_message(0, message, 0.0)
    synchroniser.take(0.0)
    intake = synchroniser.intakes[0]
    assert intake.buffer.values.tolist() == [[2.0, 1.0, 1.0]] * 2 and intake.refused == {
        "without the requested values": 1
    }


def test_a_field_of_fields_means_all_numbers_below_it() -> None:
    found = plan("geometry_msgs/PoseStamped", "pose")
    assert found.names[:4] == [
        "/t.pose.position.x",
        "/t.pose.position.y",
        "/t.pose.position.z",
        "/t.pose.orientation.x",
    ]
    assert [column.interpolation for column in found.sources[0].columns] == ["linear"] * 3 + ["slerp"] * 4
    assert [column.unit for column in found.sources[0].columns] == ["m"] * 3 + ["1"] * 4
    message = PoseStamped()
    message.pose.position = Point(1, 2, 3)
    message.pose.orientation.w = 1.0
    assert taken("geometry_msgs/PoseStamped", ["pose"], message) == ([5_000_000_007], [[1, 2, 3, 0, 0, 0, 1]])


def test_a_body_is_found_by_name_and_one_that_is_not_tracked_is_not_a_number() -> None:
    bodies = [RigidBodyState(name="table", tracking_valid=True), RigidBodyState(name="hand", tracking_valid=True)]
    bodies[1].pose.position.z = 0.5
    signals = ["rigid_bodies[hand].pose.position", "rigid_bodies[hand].tracking_valid"]
    assert taken("hric_msgs/MocapData", signals, MocapData(rigid_bodies=bodies))[1] == [[0, 0, 0.5, 1.0]]
    bodies[1].tracking_valid = False
    for seen in (bodies, bodies[:1]):
        row = taken("hric_msgs/MocapData", signals, MocapData(rigid_bodies=seen))[1][0]
        assert all(math.isnan(value) for value in row[:3]) and row[3] == 0.0


def test_a_labelled_marker_is_found_by_its_name_while_it_is_seen() -> None:
    signals = ["labelled_markers[hand/1].x"]
    seen = MocapData(labelled_marker_names=["table/1", "hand/1"], labelled_markers=[Point(), Point(4, 0, 0)])
    assert taken("hric_msgs/MocapData", signals, seen)[1] == [[4.0]]
    assert math.isnan(taken("hric_msgs/MocapData", signals, MocapData())[1][0][0])


def test_a_chunk_is_taken_apart_into_samples_with_stamps_of_their_own() -> None:
    message = SampleChunk(channels=["A", "B 2", "C"], rate=2000.0, data=list(range(9)))
    stamps, values = taken("hric_msgs/SampleChunk", ["data[C, B 2]"], message)
    assert stamps == [5_000_000_007, 5_000_500_007, 5_001_000_007] and values == [[2, 1], [5, 4], [8, 7]]


def test_every_cycle_of_the_control_log_is_a_sample() -> None:
    log = ControlLog(
        joint_names=["a", "b"], n_cycles=2, time=[0.25, 0.251], position=[1, 2, 3, 4], command=[5, 6, 7, 8]
    )
    stamps, values = taken("hric_msgs/ControlLog", ["position[b]", "command[a, b]"], log)
    assert stamps == [5_000_000_007, 5_001_000_007] and values == [[2, 5, 6], [4, 7, 8]]


def test_elements_are_chosen_by_number_and_whole_lists_of_fixed_length_without() -> None:
    state = FrankaState()
    state.O_T_EE = list(range(16))
    assert taken("franka_msgs/FrankaState", ["O_T_EE[12, 13, 14]"], state)[1] == [[12, 13, 14]]
    assert len(plan("franka_msgs/FrankaState", "q").names) == 7


def test_a_force_and_its_parts_can_be_named_in_any_order() -> None:
    message = WrenchStamped()
    message.wrench.force.z, message.wrench.torque.x = -9.0, 0.5
    assert taken("geometry_msgs/WrenchStamped", ["wrench.torque.x", "wrench.force"], message)[1] == [[0.5, 0, 0, -9.0]]


def test_whole_numbers_and_parts_of_a_quaternion_are_held_by_default() -> None:
    signals = [
        "frame_number",
        "rigid_bodies[hand].pose.orientation.w",
        {"field": "latency", "interpolation": "hold", "unit": "ms"},
    ]
    columns = plan("hric_msgs/MocapData", *signals).sources[0].columns
    assert [column.interpolation for column in columns] == ["hold"] * 3 and columns[2].unit == "ms"


@pytest.mark.parametrize(
    ("signal", "text"),
    [
        ("positions[a]", "no field 'positions' in sensor_msgs/JointState"),
        ("position", "list of any length"),
        ("position[]", "empty brackets"),
        ("position[a", "elements in brackets"),
        ("name[0]", "not a number"),
        ("position[a].x", "has no field 'x'"),
        ("header[0]", "is not a list"),
        ({"field": "position[a]", "interpolation": "cubic"}, "valid: linear, hold, slerp"),
        ({"field": "position[a]", "interpolation": "slerp"}, "no whole quaternion"),
        ({"fields": "position[a]"}, "no parameter 'fields'"),
        (7.5, "valid: a text, or a mapping"),
    ],
)
def test_a_signal_that_does_not_exist_is_refused_by_name(signal: Any, text: str) -> None:
    with pytest.raises(HricError) as error:
        plan("sensor_msgs/JointState", signal)
    assert text in str(error.value) and "sync.sources[0].signals[0]" in str(error.value)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"policy": "closest"}, "valid: exact, approximate, resample"),
        ({"policy": "exact"}, "sync.reference is ''; valid: one of /t"),
        ({"policy": "approximate", "reference": "/u"}, "sync.reference is '/u'; valid: one of /t"),
        ({"policy": "approximate", "reference": "/t", "rate": 10}, "sync.rate is given"),
        ({"reference": "/t"}, "reference of policy resample is a rate"),
        ({"rate": 0}, "sync.rate is 0; valid: a finite number above 0"),
        ({"tolerance": -1}, "sync.tolerance is -1"),
        ({"incomplete": "keep"}, "valid: mark, drop"),
        ({"sources": []}, "sync.sources is []; valid: a list"),
        ({"speed": 3}, "no parameter 'speed'"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_by_name(changes: dict[str, Any], text: str) -> None:
    source = {"topic": "/t", "type": "geometry_msgs/PoseStamped", "signals": ["pose"]}
    with pytest.raises(HricError) as error:
        read_plan("sync", {"sources": [source], **changes})
    assert text in str(error.value)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"type": "geometry_msgs/Point"}, "no header"),
        ({"type": "geometry_msgs/Nothing"}, "valid: a message type that is built"),
        ({"type": "nonsense"}, "valid: a message type that is built"),
        ({"topic": ""}, "topic is ''"),
        ({"signals": ["pose", "pose.position.x"]}, "/t.pose.position.x more than once"),
        ({"max_gap": 0}, "max_gap is 0"),
        ({"type": "hric_msgs/SampleChunk", "signals": ["rate"]}, "elements of data"),
        ({"type": "hric_msgs/ControlLog", "signals": ["n_cycles"]}, "elements of position"),
        (
            {"signals": [{"field": "pose", "interpolation": "linear"}], "interpolation": "linear"},
            "no parameter 'interpolation'",
        ),
    ],
)
def test_a_source_that_cannot_be_is_refused_by_name(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(HricError) as error:
        read_plan(
            "sync", {"sources": [{"topic": "/t", "type": "geometry_msgs/PoseStamped", "signals": ["pose"], **changes}]}
        )
    assert text in str(error.value) and "sync.sources" in str(error.value)


def test_a_topic_twice_is_refused() -> None:
    source = {"topic": "/t", "type": "geometry_msgs/PoseStamped", "signals": ["pose"]}
    with pytest.raises(HricError, match="names /t more than once"):
        read_plan("sync", {"sources": [source, source]})


def test_values_that_pass_all_the_way_are_those_of_the_message() -> None:
    synchroniser = Synchroniser(plan("sensor_msgs/JointState", "position[a]", rate=10.0), 0.0)
    for tenth in range(1, 6):
        message = JointState(name=["a"], position=[float(tenth)])
        message.header.stamp = genpy.Time(0, tenth * 100_000_000)
        synchroniser.push_message(0, message, 0.0)
    batch = synchroniser.take(0.0)
    assert batch is not None and np.array_equal(batch.values[:, 0], [1, 2, 3, 4, 5])
