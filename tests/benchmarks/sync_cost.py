"""What synchronising a data collection costs, and how well it is done: Python's own filter, ours, and C++'s, each as a process of its own.

    python tests/benchmarks/sync_cost.py [seconds] [word of a variant's name ...]

The robot at 1 kHz, a body at 240 Hz, EMG at 2 kHz and a force plate at 1 kHz, in the three forms of sync_feed.py: as a data collection records them,
with a JointState per cycle, and with no message of more than one sample. Every value tells its own time, so that the skew is measured and not
claimed. The share of a core is processor time of the process over the time of the feed; it depends on the machine, and less on its load.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "src" / "hric_perception" / "test"))
from sync_feed import FORMS, RECORDED, SINGLE, feeds

ROOT = Path(__file__).parents[2]
FEED = ROOT / "src" / "hric_perception" / "test" / "sync_feed.py"

OUTPUT = "/sync_cost"
TICK = os.sysconf("SC_CLK_TCK")
SLOP = 0.01
"""[s], of all that take the nearest samples."""


class Variant(NamedTuple):
    """A synchroniser.

    Attributes:
        name: for people.
        form: of what it is fed with.
        command: that starts it, without the plan.
        plan: of our own nodes; None: the filter of rospy.
    """

    name: str
    form: str
    command: Sequence[str]
    plan: dict[str, Any] | None


class Result(NamedTuple):
    """What came of it.

    Attributes:
        name: of the variant.
        cpu: share of a core [1].
        rate: of synchronised samples [Hz].
        skew: largest distance in time of a value from its stamp [s]; mean over all values of it.
        load: of the machine, for what it is worth.
    """

    name: str
    cpu: float
    rate: float
    skew: float
    mean: float
    load: float


def sources(form: str) -> list[dict[str, Any]]:
    """Of the plan: one value of each source, and as many more as a data collection takes."""
    joints = [f"position[{', '.join(f'panda_joint{index}' for index in range(1, 8))}]", "velocity[0, 1, 2, 3, 4, 5, 6]"]
    emg = f"data[{', '.join(f'EMG{index}' for index in range(1, 9))}]"
    plate = {"topic": "/hric/perception/force_plate/1/samples", "type": "hric_msgs/SampleChunk", "signals": ["data[Fx, Fy, Fz, Mx, My, Mz]"]}
    robot = {"topic": "/joint_states", "type": "sensor_msgs/JointState", "signals": joints}
    if form == RECORDED:
        robot = {"topic": "/control_log", "type": "hric_msgs/ControlLog", "signals": joints}
    if form == SINGLE:
        plate = {"topic": "/hric/perception/force_plate/1/wrench", "type": "geometry_msgs/WrenchStamped", "signals": ["wrench"]}
    return [
        robot,
        {"topic": "/hric/perception/mocap", "type": "hric_msgs/MocapData", "signals": ["rigid_bodies[hand].pose"]},
        {"topic": "/hric/perception/emg/raw", "type": "hric_msgs/SampleChunk", "signals": [emg]},
        plate,
    ]


FIRST = (0, 14, 21, 29)
"""Of each source, the value that tells the time."""


def variants() -> list[Variant]:
    """All that are compared."""
    python, cpp = [sys.executable, str(ROOT / "src/hric_perception/nodes/synchronizer")], [str(ROOT / "devel/lib/hric_perception/synchronizer_cpp")]
    found = []
    for form in FORMS:
        nearest = {"policy": "approximate", "reference": "/hric/perception/mocap", "tolerance": SLOP, "sources": sources(form)}
        for queue in (100, 10):
            found.append(Variant(f"rospy, queue {queue}; {form}", form, [sys.executable, __file__, "--filter", str(queue), form], None))
        found += [Variant(f"ours, approximate; {form}", form, python, nearest), Variant(f"C++, approximate; {form}", form, cpp, nearest)]
        for rate in (100.0, 1000.0):
            plan = {"policy": "resample", "rate": rate, "sources": sources(form)}
            found.append(Variant(f"ours, resample {rate:g} Hz; {form}", form, python, plan))
    return found


def measure(variant: Variant, seconds: float) -> Result:
    """Run it under the master of this process, which must be a node."""
    import rospy

    from hric_msgs.msg import SyncedSample

    seen: list[Any] = []
    subscription = rospy.Subscriber(OUTPUT, SyncedSample, seen.append, queue_size=None, tcp_nodelay=True)
    if variant.plan is not None:
        rospy.set_param("/synchronizer", {"plan": variant.plan, "topic": OUTPUT})
    node = subprocess.Popen([*variant.command, "__name:=synchronizer"], stdout=subprocess.DEVNULL)
    feed = subprocess.Popen([sys.executable, str(FEED), str(seconds), variant.form], stdout=subprocess.DEVNULL)
    try:
        while not seen and node.poll() is None and feed.poll() is None:
            time.sleep(0.02)
        begin, used, load = time.monotonic(), processor_time(node.pid), os.getloadavg()[0]
        feed.wait(seconds + 60.0)
        elapsed, spent = time.monotonic() - begin, processor_time(node.pid) - used
    finally:
        for process in (node, feed):
            process.kill()
            process.wait()
        subscription.unregister()
    return _result(variant.name, spent / elapsed, seconds, seen, load)


def _result(name: str, cpu: float, seconds: float, seen: list[Any], load: float) -> Result:
    if not seen:
        return Result(name, cpu, 0.0, float("nan"), float("nan"), load)
    stamps = np.array([message.header.stamp.to_nsec() for message in seen])
    codes = np.array([[message.values[index] for index in FIRST] for message in seen])
    # The feed's own begin is not known here: the source that is nearest to all stamps tells it.
    since = (stamps - stamps[0]) * 1e-9
    begin = np.nanmedian(codes[:, FIRST_EXACT] - since)
    skew = np.abs(codes - since[:, None] - begin)
    return Result(name, cpu, len(seen) / seconds, float(np.nanmax(skew)), float(np.nanmean(skew)), load)


FIRST_EXACT = 1
"""Of the sources: motion capture, the reference of those that have one; of an interpolated one all are exact."""


def processor_time(pid: int) -> float:
    """Processor time of a process so far, all threads [s]; 0 when it is gone."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except FileNotFoundError:
        return 0.0
    return (int(words[11]) + int(words[12])) / TICK


def run_filter(queue: int, form: str) -> None:
    """The filter of rospy as a node: ApproximateTimeSynchronizer, publishing what our nodes publish."""
    import message_filters
    import rospy

    from hric_msgs.msg import SyncedSample

    rospy.init_node("synchronizer")
    publisher = rospy.Publisher(OUTPUT, SyncedSample, queue_size=1000)
    chosen = feeds(form)
    subscribers = [message_filters.Subscriber(feed.topic, type(feed.make(0.0, 0.0, 0)), queue_size=None, tcp_nodelay=True) for feed in chosen]
    synchroniser = message_filters.ApproximateTimeSynchronizer(subscribers, queue, SLOP)

    synchroniser.registerCallback(lambda *messages: publisher.publish(_joined(*messages)))
    rospy.spin()


def _joined(robot: Any, bodies: Any, emg: Any, plate: Any) -> Any:
    """The first sample of each message, as our nodes publish them."""
    from hric_msgs.msg import SyncedSample

    position, turn = bodies.rigid_bodies[0].pose.position, bodies.rigid_bodies[0].pose.orientation
    force = list(plate.data[:6]) if hasattr(plate, "data") else [plate.wrench.force.x] * 6
    body = [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w]
    ages = [(bodies.header.stamp - message.header.stamp).to_sec() for message in (robot, bodies, emg, plate)]
    message = SyncedSample(values=[*robot.position[:7], *robot.velocity[:7], *body, *emg.data[:8], *force], age=ages, valid=[True] * 4)
    message.header.stamp = bodies.header.stamp
    return message


def table(results: Sequence[Result]) -> str:
    """As Markdown."""
    lines = ["| synchroniser | share of a core | samples per second | skew, largest | mean | load |", "|---|---|---|---|---|---|"]
    for one in results:
        figures = f"{100 * one.cpu:.0f} % | {one.rate:.0f} | {1e3 * one.skew:.3f} ms | {1e3 * one.mean:.3f} ms | {one.load:.1f}"
        lines.append(f"| {one.name} | {figures} |")
    return "\n".join(lines)


def main() -> None:
    """Measure what is asked for."""
    import rospy

    from hric_control.testing import start_roscore

    seconds, words = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0, sys.argv[2:]
    start_roscore()
    rospy.init_node("sync_cost", disable_signals=True)
    chosen = [variant for variant in variants() if all(word in variant.name for word in words)]
    results = []
    for variant in chosen:
        results.append(measure(variant, seconds))
        print(table(results[-1:]).splitlines()[-1], flush=True)
    print(table(results))


if __name__ == "__main__":
    if "--filter" in sys.argv:
        run_filter(int(sys.argv[2]), sys.argv[3])
    else:
        main()
