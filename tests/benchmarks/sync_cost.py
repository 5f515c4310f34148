"""Measure cost and accuracy of the synchroniser and of rospy's message_filters for a data collection, as processes.

    python tests/benchmarks/sync_cost.py [--seconds 12] [--rounds 5] [word of a variant's name ...]

The robot at 1 kHz, a body at 240 Hz, EMG at 2 kHz and a force plate at 1 kHz, in the three forms of sync_feed.py: as a
data collection records them, with a JointState per cycle, and with no message of more than one sample. Every value is
the time it was sampled at, so the skew is measured. The share of a core is processor time of the process over the time
of the feed; it depends on the machine, and less on its load. Variants take turns, and the table holds the median of the
rounds; ratios are of one round each, to the first variant of the same form.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2] / "src" / name / "test") for name in ("hric_perception", "hric_core")]
from sync_feed import FORMS, RECORDED, SINGLE, feeds  # noqa: E402

ROOT = Path(__file__).parents[2]
FEED = ROOT / "src" / "hric_perception" / "test" / "sync_feed.py"

OUTPUT = "/sync_cost"
TICK = os.sysconf("SC_CLK_TCK")
SLOP = 0.01
"""Tolerance of synchronisers that use the nearest samples [s]."""


class Variant(NamedTuple):
    """Synchroniser to measure.

    Attributes:
        name: name in the table.
        form: form of its input messages.
        command: command that starts it, without the plan.
        plan: plan of the node synchronizer; None for the filter of rospy.
    """

    name: str
    form: str
    command: Sequence[str]
    plan: dict[str, Any] | None


class Result(NamedTuple):
    """Result of a measurement.

    Attributes:
        name: name of the variant.
        cpu: processor time as a share of a core [1].
        rate: rate of synchronised samples [Hz].
        complete: number of samples with a value of every source, divided by the instants of the feed [1].
        latency: time from the instant to the arrival at a subscriber, median [s]; late: 99th percentile [s].
        skew: largest time difference of a value from its stamp [s]; mean: mean over all values [s].
        load: load average of the machine.
    """

    name: str
    cpu: float
    rate: float
    complete: float
    latency: float
    late: float
    skew: float
    mean: float
    load: float


def sources(form: str) -> list[dict[str, Any]]:
    """Return the sources of the plan: one time value of each source, and as many values as in a data collection."""
    joints = [f"position[{', '.join(f'panda_joint{index}' for index in range(1, 8))}]", "velocity[0, 1, 2, 3, 4, 5, 6]"]
    emg = f"data[{', '.join(f'EMG{index}' for index in range(1, 9))}]"
    plate = {
        "topic": "/hric/perception/force_plate/1/samples",
        "type": "hric_msgs/SampleChunk",
        "signals": ["data[Fx, Fy, Fz, Mx, My, Mz]"],
    }
    robot = {"topic": "/joint_states", "type": "sensor_msgs/JointState", "signals": joints}
    if form == RECORDED:
        robot = {"topic": "/control_log", "type": "hric_msgs/ControlLog", "signals": joints}
    if form == SINGLE:
        plate = {
            "topic": "/hric/perception/force_plate/1/wrench",
            "type": "geometry_msgs/WrenchStamped",
            "signals": ["wrench"],
        }
    return [
        robot,
        {"topic": "/hric/perception/mocap", "type": "hric_msgs/MocapData", "signals": ["rigid_bodies[hand].pose"]},
        {"topic": "/hric/perception/emg/raw", "type": "hric_msgs/SampleChunk", "signals": [emg]},
        plate,
    ]


FIRST = (0, 14, 21, 29)
"""Index of the value of each source that is its time."""


def variants() -> list[Variant]:
    """Return all variants to compare."""
    python = [sys.executable, str(ROOT / "src/hric_perception/nodes/synchronizer")]
    found = []
    for form in FORMS:
        nearest = {
            "policy": "approximate",
            "reference": "/hric/perception/mocap",
            "tolerance": SLOP,
            "sources": sources(form),
        }
        for queue in (100, 10):
            found.append(
                Variant(
                    f"rospy, queue {queue}; {form}",
                    form,
                    [sys.executable, __file__, "--filter", str(queue), form],
                    None,
                )
            )
        found.append(Variant(f"ours, approximate; {form}", form, python, nearest))
        for rate in (100.0, 1000.0):
            plan = {"policy": "resample", "rate": rate, "sources": sources(form)}
            found.append(Variant(f"ours, resample {rate:g} Hz; {form}", form, python, plan))
    return found


def measure(variant: Variant, seconds: float) -> Result:
    """Run a variant on the master of this process, which must be a node, and measure it."""
    import rospy

    from hric_msgs.msg import SyncedSample

    seen: list[tuple[float, Any]] = []

    def see(message: Any) -> None:
        seen.append((time.time(), message))

    subscription = rospy.Subscriber(OUTPUT, SyncedSample, see, queue_size=None, tcp_nodelay=True)
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
    return _result(variant, spent / elapsed, seconds, seen, load)


def _result(variant: Variant, cpu: float, seconds: float, seen: list[tuple[float, Any]], load: float) -> Result:
    name, nan = variant.name, float("nan")
    if not seen:
        return Result(name, cpu, 0.0, 0.0, nan, nan, nan, nan, load)
    arrived = np.array([arrival for arrival, _ in seen])
    stamps = np.array([message.header.stamp.to_nsec() for _, message in seen])
    codes = np.array([[message.values[index] for index in FIRST] for _, message in seen])
    # The start of the feed is not known here; it is computed from the source that is nearest to all stamps.
    since = (stamps - stamps[0]) * 1e-9
    begin = np.nanmedian(codes[:, FIRST_EXACT] - since)
    skew = np.abs(codes - since[:, None] - begin)
    latency = arrived - stamps * 1e-9
    instants = seconds * (variant.plan or {}).get("rate", BODIES)
    complete = len({message.header.stamp.to_nsec() for _, message in seen if all(message.valid)}) / instants
    median, late = np.percentile(latency, (50.0, 99.0))
    largest, mean = float(np.nanmax(skew)), float(np.nanmean(skew))
    return Result(name, cpu, len(seen) / seconds, complete, float(median), float(late), largest, mean, load)


BODIES = 240.0
"""Rate of motion capture, whose stamps are the instants of policies with a reference [Hz]."""
FIRST_EXACT = 1
"""Index of motion capture, the reference source, whose values are exact; of interpolated values all are exact."""


def processor_time(pid: int) -> float:
    """Return the processor time of a process with all threads [s]; 0 if it has ended."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except FileNotFoundError:
        return 0.0
    return (int(words[11]) + int(words[12])) / TICK


def run_filter(queue: int, form: str) -> None:
    """Run rospy's ApproximateTimeSynchronizer as a node that publishes the same messages as the node synchronizer."""
    import message_filters
    import rospy

    from hric_msgs.msg import SyncedSample

    rospy.init_node("synchronizer")
    publisher = rospy.Publisher(OUTPUT, SyncedSample, queue_size=1000)
    chosen = feeds(form)
    subscribers = [
        message_filters.Subscriber(feed.topic, type(feed.make(0.0, 0.0, 0)), queue_size=None, tcp_nodelay=True)
        for feed in chosen
    ]
    synchroniser = message_filters.ApproximateTimeSynchronizer(subscribers, queue, SLOP)

    synchroniser.registerCallback(lambda *messages: publisher.publish(_joined(*messages)))
    rospy.spin()


def _joined(robot: Any, bodies: Any, emg: Any, plate: Any) -> Any:
    """Return the first sample of each message as a SyncedSample."""
    from hric_msgs.msg import SyncedSample

    position, turn = bodies.rigid_bodies[0].pose.position, bodies.rigid_bodies[0].pose.orientation
    force = list(plate.data[:6]) if hasattr(plate, "data") else [plate.wrench.force.x] * 6
    body = [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w]
    ages = [(bodies.header.stamp - message.header.stamp).to_sec() for message in (robot, bodies, emg, plate)]
    message = SyncedSample(
        values=[*robot.position[:7], *robot.velocity[:7], *body, *emg.data[:8], *force], age=ages, valid=[True] * 4
    )
    message.header.stamp = bodies.header.stamp
    return message


def medians(rounds: Sequence[Result]) -> Result:
    """Return the median of each figure of one variant."""
    columns = zip(*(one[1:] for one in rounds), strict=True)
    return Result(rounds[0].name, *map(statistics.median, columns))


COLUMNS = (
    *("synchroniser; form", "share of a core", "to the first", "samples per second", "complete"),
    *("latency, median", "latency, 99 %", "skew, largest", "skew, mean", "load"),
)


def table(rounds: Sequence[Sequence[Result]]) -> str:
    """Return the table in Markdown with the medians of the rounds, each of which has a result of every variant."""
    lines = [f"| {' | '.join(COLUMNS)} |", "|---" * len(COLUMNS) + "|"]
    for results in zip(*rounds, strict=True):
        whole, form = medians(results), results[0].name.partition("; ")[2]
        first = next(index for index, other in enumerate(rounds[0]) if other.name.endswith(form))
        ratio = statistics.median(one.cpu / beside[first].cpu for one, beside in zip(results, rounds, strict=True))
        share = f"{100 * whole.cpu:.1f} % | {ratio:.2f} | {whole.rate:.0f} | {whole.complete:.4f}"
        latency = f"{1e3 * whole.latency:.1f} ms | {1e3 * whole.late:.1f} ms"
        skew = f"{1e3 * whole.skew:.3f} ms | {1e3 * whole.mean:.3f} ms"
        lines.append(f"| {whole.name} | {share} | {latency} | {skew} | {whole.load:.1f} |")
    return "\n".join(lines)


def main() -> None:
    """Run the command."""
    import rospy
    from real_master import start_roscore

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=12.0, help="duration of the input data [s]")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("words", nargs="*", help="only variants whose names contain all these words")
    chosen = parser.parse_args()
    start_roscore()
    rospy.init_node("sync_cost", disable_signals=True)
    wanted = [variant for variant in variants() if all(word in variant.name for word in chosen.words)]
    rounds = []
    for number in range(chosen.rounds):
        rounds.append([measure(variant, chosen.seconds) for variant in wanted])
        print(f"round {number + 1}\n{table(rounds[-1:])}", flush=True)
    print(f"medians\n{table(rounds)}")


if __name__ == "__main__":
    if "--filter" in sys.argv:
        run_filter(int(sys.argv[2]), sys.argv[3])
    else:
        main()
