"""The node `synchronizer_cpp` under a master: message_filters of C++, on the same plans as the node in Python."""

from __future__ import annotations

import contextlib
import itertools
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sync_sources import LIMIT, Feeder, listen, wait

from hric_control.testing import ros, roscore
from hric_msgs.msg import SyncedSample, SyncLayout, SyncStatus

__all__ = ["ros", "roscore"]
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
PROGRAM = Path(__file__).parents[3] / "devel" / "lib" / "hric_perception" / "synchronizer_cpp"
SOURCES = [
    {"topic": "/sync_joints", "type": "sensor_msgs/JointState", "signals": ["position[a]"]},
    {"topic": "/sync_chunks", "type": "hric_msgs/SampleChunk", "signals": ["data[time]"], "timeout": 0.4},
]


@contextlib.contextmanager
def node(name: str, plan: Any) -> Iterator[subprocess.Popen[str]]:
    import rospy

    rospy.set_param(f"/{name}", {"plan": plan, "topic": f"/{name}"})
    child = subprocess.Popen([str(PROGRAM), f"__name:={name}"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield child
    finally:
        if child.poll() is None:
            child.kill()
            child.communicate()


@pytest.mark.parametrize(("policy", "reference", "apart"), [("exact", "/sync_joints", 0.0), ("approximate", "/sync_joints", 5e-4)])
def test_values_of_a_set_tell_times_that_are_as_near_as_the_policy_says(ros: str, policy: str, reference: str, apart: float) -> None:
    name = f"cpp_{policy}"
    samples, layouts, feeder = listen(f"/{name}", SyncedSample), listen(f"/{name}_layout", SyncLayout), Feeder()
    with node(name, {"policy": policy, "reference": reference, "sources": SOURCES}) as child:
        wait(lambda: layouts and feeder.heard())
        feeder.feed(1.5)
        wait(lambda: len(samples) > 100)
        child.send_signal(signal.SIGINT)
        assert child.wait(LIMIT) == 0
    layout = layouts[-1]
    assert layout.names == ["/sync_joints.position[a]", "/sync_chunks.data[time]"] and layout.units == ["rad", "s"]
    assert (layout.policy, layout.reference, set(layout.interpolations)) == (policy, reference, {"exact" if policy == "exact" else "nearest"})
    stamps = [message.header.stamp.to_nsec() for message in samples]
    assert all(after > before for before, after in itertools.pairwise(stamps))
    for message in samples:
        assert message.values[0] == pytest.approx(message.header.stamp.to_sec() - feeder.begin, abs=2e-6) and all(message.valid)
        later = message.values[0] - message.values[1]
        assert abs(later) <= apart + 2e-6 and message.age[1] == pytest.approx(later, abs=2e-6)


def test_a_source_that_dies_is_named(ros: str) -> None:
    statuses, diagnostics, feeder = listen("/cpp_starve_status", SyncStatus), listen("/diagnostics", DiagnosticArray), Feeder()
    with node("cpp_starve", {"policy": "approximate", "reference": "/sync_joints", "sources": SOURCES}):
        wait(feeder.heard)
        feeder.feed(0.7)
        wait(lambda: statuses and not any(statuses[-1].starving))
        feeder.feed(0.8, chunks=False)
        wait(lambda: statuses[-1].starving == [False, True] or feeder.feed(0.1, chunks=False))
        assert statuses[-1].reasons == ["", "silent"] and statuses[-1].dropped > 0
        feeder.feed(0.1, chunks=False)
        errors = [state for message in diagnostics for state in message.status if state.level == DiagnosticStatus.ERROR]
        assert any("/sync_chunks" in state.message and state.name == "cpp_starve: sources" for state in errors)


def test_a_source_whose_clock_jumps_is_named_and_used_again_when_it_is_back(ros: str) -> None:
    statuses, samples, feeder = listen("/cpp_jump_status", SyncStatus), listen("/cpp_jump", SyncedSample), Feeder()
    with node("cpp_jump", {"policy": "approximate", "reference": "/sync_joints", "sources": SOURCES}):
        wait(feeder.heard)
        feeder.feed(0.5)
        wait(lambda: samples)
        feeder.feed(0.8, shift=1000.0)
        wait(lambda: statuses[-1].starving == [False, True] or feeder.feed(0.1, shift=1000.0))
        assert "another time" in statuses[-1].reasons[1] and statuses[-1].refused[1] > 50
        before = len(samples)
        feeder.feed(0.5)
        wait(lambda: len(samples) > before + 20)


@pytest.mark.parametrize(
    ("plan", "text"),
    [
        ({"policy": "resample", "reference": "/sync_joints", "sources": SOURCES}, "valid here: exact, approximate"),
        ({"policy": "exact", "reference": "/none", "sources": SOURCES}, "valid: one of /sync_joints, /sync_chunks"),
        ({"policy": "exact", "reference": "/sync_joints", "sources": SOURCES[:1]}, "valid here: 2 to 6"),
        ({"policy": "exact", "rate": 10, "sources": SOURCES}, "no key 'rate'"),
        ({"policy": "exact", "sources": [{**SOURCES[0], "type": "sensor_msgs/Imu"}]}, "geometry_msgs/PoseStamped"),
        ({"policy": "exact", "sources": [{**SOURCES[0], "signals": ["places[a]"]}]}, "no field 'places' in sensor_msgs/JointState"),
    ],
)
def test_a_plan_that_cannot_be_ends_the_node_with_one_line(ros: str, plan: Any, text: str) -> None:
    with node("cpp_wrong", plan) as child:
        output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 1 and text in output and output.count("\n") == 1


def test_help_needs_no_master() -> None:
    answer = subprocess.run([str(PROGRAM), "--help"], capture_output=True, text=True, timeout=LIMIT)
    assert answer.returncode == 0 and "Usage" in answer.stdout
