"""The node `synchronizer` under a ROS master."""

import contextlib
import itertools
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from real_master import end_nodes, ros, roscore
from sync_sources import LIMIT, Feeder, listen, wait

from hric_msgs.msg import SyncedSample, SyncLayout, SyncStatus

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
PACKAGE = Path(__file__).parents[1]
PLAN = {
    "rate": 50.0,
    "sources": [
        {"topic": "/sync_joints", "type": "sensor_msgs/JointState", "signals": ["position[a]"]},
        {"topic": "/sync_chunks", "type": "hric_msgs/SampleChunk", "signals": ["data[time]"]},
    ],
}


@contextlib.contextmanager
def node(plan: Any, *arguments: str, name: str = "synchronizer") -> Iterator[subprocess.Popen[str]]:
    text = yaml.safe_dump(plan, default_flow_style=True, width=10_000).strip()
    command = [sys.executable, str(PACKAGE / "nodes" / name), f"_plan:={text}", *arguments]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield child
    finally:
        end_nodes(child)


def test_samples_come_at_the_rate_with_their_layout_and_hold_the_time_of_their_stamps(ros: str) -> None:
    samples, layouts, feeder = (
        listen("/hric/perception/sync", SyncedSample),
        listen("/hric/perception/sync_layout", SyncLayout),
        Feeder(),
    )
    with node(PLAN) as child:
        wait(lambda: layouts and feeder.heard())
        feeder.feed(2.0)
        wait(lambda: len(samples) > 80)
        child.send_signal(signal.SIGINT)
        assert child.wait(LIMIT) == 0
    layout = layouts[-1]
    assert layout.names == ["/sync_joints.position[a]", "/sync_chunks.data[time]"] and layout.units == ["rad", "s"]
    assert (layout.policy, layout.rate, layout.reference) == ("resample", 50.0, "")
    stamps = [message.header.stamp.to_nsec() for message in samples]
    assert {after - before for before, after in itertools.pairwise(stamps)} == {20_000_000}
    for message in samples:
        assert all(message.valid)
        assert message.values == pytest.approx(
            [message.header.stamp.to_sec() - feeder.begin] * 2, abs=2e-6
        )  # to_sec rounds to 0.2 us


def test_a_source_that_dies_is_named_in_status_and_diagnostics_while_the_others_go_on(ros: str) -> None:
    statuses, diagnostics = listen("/starve_status", SyncStatus), listen("/diagnostics", DiagnosticArray)
    samples, feeder = listen("/starve", SyncedSample), Feeder()
    with node(PLAN, "_topic:=/starve", "__name:=starve"):
        wait(feeder.heard)
        feeder.feed(1.0)
        wait(lambda: statuses and not any(statuses[-1].starving) and samples)
        died = time.monotonic()
        feeder.feed(1.5, chunks=False)
        wait(lambda: statuses[-1].starving == [False, True] and not any(samples[-1].valid[1:]))
        assert "silent for" in statuses[-1].reasons[1] and samples[-1].valid[0] and time.monotonic() - died < LIMIT
        errors = [state for message in diagnostics for state in message.status if state.level == DiagnosticStatus.ERROR]
        assert errors and "/sync_chunks" in errors[-1].message and errors[-1].name == "starve: sources"
        feeder.feed(1.0)
        wait(lambda: not any(statuses[-1].starving) and all(samples[-1].valid))


@pytest.mark.parametrize(
    ("plan", "text"),
    [
        (
            {**PLAN, "policy": "sometimes"},
            "/synchronizer/plan/policy is 'sometimes'; valid: exact, approximate, resample",
        ),
        ({"sources": [{**PLAN["sources"][0], "type": "std_msgs/Float64"}]}, "has no header"),  # type: ignore[index, dict-item]
    ],
)
def test_a_plan_that_cannot_be_ends_the_node_with_one_line(ros: str, plan: Any, text: str) -> None:
    with node(plan) as child:
        output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2 and text in output and "Traceback" not in output


def test_help_needs_no_master() -> None:
    answer = subprocess.run(
        [sys.executable, str(PACKAGE / "nodes" / "synchronizer"), "--help"],
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert answer.returncode == 0 and "usage: rosrun hric_perception synchronizer" in answer.stdout


def test_the_name_of_the_node_in_cpp_warns_and_serves_its_policies(ros: str) -> None:
    samples, feeder = listen("/old_name", SyncedSample), Feeder()
    plan = {**PLAN, "policy": "approximate", "reference": "/sync_joints"}
    del plan["rate"]
    with node(plan, "_topic:=/old_name", "__name:=old_name", name="synchronizer_cpp") as child:
        wait(feeder.heard)
        feeder.feed(1.0)
        wait(lambda: len(samples) > 50)
        child.send_signal(signal.SIGINT)
        output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0 and output.count("[WARN]") == 1 and "docs/choices.md" in output
    for message in samples:
        assert message.values[0] == pytest.approx(message.header.stamp.to_sec() - feeder.begin, abs=2e-6) and all(
            message.valid
        )
        assert abs(message.values[0] - message.values[1]) <= 5e-4 + 2e-6


def test_several_rates_of_one_plan_go_out_on_topics_of_their_own(ros: str) -> None:
    slow, fast = listen("/many_50hz", SyncedSample), listen("/many_200hz", SyncedSample)
    layouts, feeder = [listen(f"/many_{rate}hz_layout", SyncLayout) for rate in (50, 200)], Feeder()
    with node(PLAN, "_topic:=/many", "_rates:=[50, 200]", "__name:=many"):
        wait(lambda: all(layouts) and feeder.heard())
        feeder.feed(2.0)
        wait(lambda: len(slow) > 60 and len(fast) > 240)
    assert [layout[-1].rate for layout in layouts] == [50.0, 200.0]
    for messages, period in ((slow, 20_000_000), (fast, 5_000_000)):
        stamps = [message.header.stamp.to_nsec() for message in messages]
        assert {after - before for before, after in itertools.pairwise(stamps)} == {period}


def test_a_backlog_goes_out_in_portions_and_whole(ros: str) -> None:
    import rospy

    samples: list[Any] = []
    listener, feeder = rospy.Subscriber("/portions", SyncedSample, samples.append), Feeder()
    with node({**PLAN, "rate": 1000.0}, "_topic:=/portions", "_period:=0.2", "__name:=portions"):
        wait(lambda: feeder.heard() and listener.get_num_connections())
        feeder.feed(2.0)
        wait(lambda: len(samples) > 1500)
    stamps = [message.header.stamp.to_nsec() for message in samples]
    assert {after - before for before, after in itertools.pairwise(stamps)} == {1_000_000}


def test_rates_that_cannot_be_end_the_node_with_one_line(ros: str) -> None:
    with node(PLAN, "_rates:=[50, 50]", "__name:=wrong_rates") as child:
        output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2 and "/wrong_rates/rates" in output and "Traceback" not in output
