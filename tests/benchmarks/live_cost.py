"""Measure processor time and latency of messages of the control loop and of a data collection, with a ROS master.

    python tests/benchmarks/live_cost.py loop [--seconds 5] [--rounds 10]
    python tests/benchmarks/live_cost.py panda [--seconds 5] [--rounds 10]      # or fr3
    python tests/benchmarks/live_cost.py collection --seconds 20 --rounds 4

`loop`: the arm behind its control box with the controllers of the default bring-up, its topics recorded and received by
a second subscriber; first at 1 kHz of real time, then unpaced. `panda`, `fr3`: the same through libfranka, with an
emulated control box that does not wait. `collection`: the experiment data_collection through scripts/bringup, with a
subscriber in addition to the recorder. The table has the median of the rounds, the lowest and the highest value.
"""

import argparse
import contextlib
import functools
import json
import math
import os
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

ROOT = Path(__file__).parents[2]
for folder in ("tests/integration", "scripts/lib", "src/franka_sim/test", "src/hric_core/test"):
    sys.path.insert(0, str(ROOT / folder))

CONTROLLERS = ("joint_state_controller", "franka_state_controller", "joint_pd_controller")
TICK = os.sysconf("SC_CLK_TCK")
Figures = dict[str, float]
BEGIN, END = "begin", "end"
"""Keys of the start and end of a measurement on the monotonic clock [s]."""
ALL, OTHERS = "all nodes", "the rest of the machine, CPU [% of a core]"
HEARD = {
    "/control_log": "hric_msgs/ControlLog",
    "/joint_states": "sensor_msgs/JointState",
    "/franka_state_controller/franka_states": "franka_msgs/FrankaState",
    "/hric/perception/mocap": "hric_msgs/MocapData",
    "/hric/perception/emg/raw": "hric_msgs/SampleChunk",
    "/hric/perception/force_plate/1/samples": "hric_msgs/SampleChunk",
    "/hric/perception/sync_1000hz": "hric_msgs/SyncedSample",
}
"""Topics whose latency is measured by their headers."""


def processor_time(pid: int) -> float:
    """Return the processor time of a process with all threads [s]; 0 if it has ended."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / TICK


def busy_time() -> float:
    """Return the processor time of all processes on the machine, including time taken by its host [s]."""
    words = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]
    return sum(int(word) for index, word in enumerate(words) if index not in (3, 4)) / TICK  # not idle, nor waiting


# The robot: nodes/robot with a clock in its loop.


class Recorder:
    """Replacement of the loop's meter that stores start and end of each cycle."""

    def __init__(self, meter: Any) -> None:
        self._cycle = meter.cycle
        self.begins: list[float] = []
        self.ends: list[float] = []

    def cycle(self, begin: float, end: float) -> None:
        """Store start and end of a cycle, like LoopMeter.cycle."""
        self.begins.append(begin)
        self.ends.append(end)
        self._cycle(begin, end)


def run_robot(seconds: float, rounds: int, path: Path, real: bool) -> None:
    """Run robots one after the other on the master of the environment, with its parameters; write the figures."""
    import rospy

    from hric_core.ros import process as ros_backlog
    from hric_core.ros.time import init_clock_node

    init_clock_node("robot", sys.argv[:1])
    ros_backlog.widen()
    found, thread = [], threading.get_native_id()
    nice = os.getpriority(os.PRIO_PROCESS, thread)
    for _ in range(rounds):
        os.setpriority(os.PRIO_PROCESS, thread, nice)  # the loop of the one before had another
        found.append(run_once(seconds, real))
    path.write_text(json.dumps(found))
    rospy.signal_shutdown("done")


def run_once(seconds: float, real: bool) -> Figures:
    """Run a robot like nodes/robot, and return its figures."""
    from hric_control.robot_app import RobotApp
    from hric_core import processes, realtime
    from hric_core.ros.node import RosNode
    from hric_core.ros.time import set_time

    app = RobotApp(RosNode(), RosNode("~"), live=True, on_clock=set_time)
    for name in CONTROLLERS:
        app.manager.load(name)
    app.manager.switch(list(CONTROLLERS), [], loop_running=False)
    app.wait_for_log_listener()
    processes.prefer_this_thread()
    app.run(1.0)
    begin = time.monotonic()
    figures = (followed if real else paced)(app, seconds) | {BEGIN: begin, END: time.monotonic()}
    figures["messages dropped by the sender [1]"] = sum(outbox.dropped for outbox in realtime._the_thread()._outboxes)
    if not real:
        figures |= unpaced(app, seconds)
    app.shutdown()
    realtime.shutdown()
    return figures


class Used:
    """Measurement of processor time and wall time since its creation."""

    def __init__(self) -> None:
        self._begin = self._now()

    def _now(self) -> tuple[float, float, float, float]:
        return processor_time(os.getpid()), busy_time(), time.thread_time(), time.perf_counter()

    def figures(self, cycles: int) -> Figures:
        """Return the figures of a run of this number of cycles."""
        node, busy, loop, wall = (now - before for now, before in zip(self._now(), self._begin, strict=True))
        return {
            "loop thread, CPU per cycle [us]": 1e6 * loop / cycles,
            "node, CPU [% of a core]": 100.0 * node / wall,
            OTHERS: 100.0 * (busy - node) / wall,
        }


def jitter(begins: list[float]) -> Figures:
    """Return the deviation of the time between successive cycles from 1 ms, for start times of cycles [s]."""
    off = 1e6 * np.abs(np.diff(np.array(begins)) - 1e-3)
    figures = {f"jitter, {share:g} % [us]": float(np.percentile(off, share)) for share in (50.0, 99.0, 99.9)}
    return figures | {"jitter, largest [us]": float(off.max())}


def paced(app: Any, seconds: float) -> Figures:
    """Measure a loop paced at 1 kHz of real time."""
    meter = app.loop._meter
    kept, used = Recorder(meter), Used()
    meter.cycle = kept.cycle
    app.run(seconds)
    meter.cycle = kept._cycle
    work = 1e6 * (np.array(kept.ends) - np.array(kept.begins))
    return used.figures(len(work)) | {
        "work of a cycle, median [us]": float(np.median(work)),
        "work of a cycle, 99 % [us]": float(np.percentile(work, 99.0)),
        "late cycles [per 1000]": 1e3 * meter.missed / len(work),
        **jitter(kept.begins),
    }


def followed(app: Any, seconds: float) -> Figures:
    """Measure a loop driven by an arm's clock."""
    hw, begins, rates, ended, used = app.hw, [], [], [], Used()
    lost = hw.lost_states

    def look(now: float) -> None:
        begins.append(time.perf_counter())
        if hw.mode.commanded:
            rates.append(hw.robot_state.control_command_success_rate)
        if hw.error:
            ended.append(hw.error)
            hw.recover()

    app.run(seconds, look)
    return used.figures(len(begins)) | {
        "success rate, mean [1]": statistics.fmean(rates[COUNTED_UP:]),
        "success rate, lowest [1]": min(rates[COUNTED_UP:]),
        "states lost [1]": hw.lost_states - lost,
        "motions ended by the arm [1]": len(ended),
        **jitter(begins),
    }


COUNTED_UP = 150
"""Number of cycles after which the arm's success rate refers to its last 100 cycles."""


def unpaced(app: Any, seconds: float) -> Figures:
    """Measure an unpaced loop."""
    app.loop.real_time_factor = 0.0
    timer = threading.Timer(seconds, app.hw.stop)
    before, loop, begin = app.cycles, time.thread_time(), time.perf_counter()
    timer.start()
    app.run()
    cycles = app.cycles - before
    return {
        "real-time factor, unpaced [1]": 1e-3 * cycles / (time.perf_counter() - begin),
        "loop thread, CPU per cycle, unpaced [us]": 1e6 * (time.thread_time() - loop) / cycles,
    }


def set_parameters(*overrides: str) -> None:
    """Set the parameters of the robot of the default bring-up."""
    import rospy

    from hric_run.definition import parameters

    def described(what: str) -> str:
        return subprocess.check_output(["rosrun", "hric_experiments", "describe", what, "none", *overrides], text=True)

    robot = yaml.safe_load(described("robot")) | {"wait_for_log_listener": 30.0}
    limits = yaml.safe_load(described("limits"))
    parts = {"robot": robot, "joint_limits": limits, "robot_description": described("urdf")}
    rospy.set_param("/use_sim_time", not overrides)
    for name, value in (parts | {name: parameters.defaults("panda")[name] for name in CONTROLLERS}).items():
        rospy.set_param(f"/{name}", value)


def measure_loop(seconds: float, rounds: int) -> list[Figures]:
    """Measure simulated robots."""
    return measure_robot(seconds, rounds)


def measure_real(robot: str, seconds: float, rounds: int) -> list[Figures]:
    """Measure robots through libfranka."""
    from fci_peer import control_box

    with control_box("--robot", robot, "--clock", "wall", "--priority", "85", "--no-collision") as (ip, _):
        arm = (f"robot.parameters.robot_ip:={ip}", f"robot.parameters.robot:={robot}")
        return measure_robot(seconds, rounds, "hw:=franka_real/FrankaHW", *arm)


def measure_robot(seconds: float, rounds: int, *overrides: str) -> list[Figures]:
    """Measure a robot with a recorder and a subscriber, on a master started by this process."""
    from real_master import start_roscore

    start_roscore()
    set_parameters(*overrides)
    with tempfile.TemporaryDirectory() as folder:
        bag, heard, out = (Path(folder) / name for name in ("run.bag", "heard.npz", "figures.json"))
        recorder = [str(ROOT / "devel/lib/hric_experiments/bag_recorder"), str(bag)]
        others = [subprocess.Popen(words) for words in (recorder, [sys.executable, __file__, "--listen", str(heard)])]
        try:
            words = [str(seconds), str(rounds), str(out), "real" if overrides else "simulated"]
            subprocess.run([sys.executable, __file__, "--robot", *words], check=True)
        finally:
            for one in others:
                one.send_signal(signal.SIGINT)
                one.wait(20.0)
        found: list[Figures] = json.loads(out.read_text())
        return [figures | latencies(heard, figures.pop(BEGIN), figures.pop(END)) for figures in found]


# The listener.


def listen(path: Path) -> None:
    """Store the arrival times of messages until SIGINT."""
    import rospy

    from hric_msgs.msg import ClockPair

    end = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: end.set())
    from rospy.impl import simtime

    simtime._is_use_simtime = lambda: False
    rospy.init_node("live_cost_listener", anonymous=True, disable_signals=True)
    heard: dict[str, list[tuple[int, int, int]]] = {topic: [] for topic in HEARD}
    pairs: list[tuple[int, int]] = []

    def keep(into: list[tuple[int, int, int]]) -> Callable[[Any], None]:
        def hear(message: Any) -> None:
            arrived = time.monotonic_ns()
            number, seconds, nanoseconds = struct.unpack_from("<III", message._buff)
            into.append((arrived, seconds * 10**9 + nanoseconds, number))

        return hear

    for topic, into in heard.items():
        rospy.Subscriber(topic, rospy.AnyMsg, keep(into), queue_size=None, tcp_nodelay=True)

    def pair(message: Any) -> None:
        pairs.append((message.monotonic, message.run_time.to_nsec()))

    rospy.Subscriber("/hric/clock", ClockPair, pair, queue_size=None)
    end.wait()
    rows = {topic.replace("/", "|"): np.array(found, np.int64) for topic, found in heard.items()}
    np.savez(path, pairs=np.array(pairs, np.int64), **rows)
    os._exit(0)


def latencies(path: Path, begin: float = 0.0, end: float = math.inf) -> Figures:
    """Return latencies from stamp to arrival in an interval of the monotonic clock [s], and numbers of lost messages.

    A message of several samples is stamped with the first of them.
    """
    figures: Figures = {}
    with np.load(path) as content:
        pairs = content["pairs"]
        for topic in HEARD:
            rows = content[topic.replace("/", "|")].reshape(-1, 3)
            rows = rows[(rows[:, 0] > begin * 1e9) & (rows[:, 0] < end * 1e9)]
            if not len(rows):
                continue
            late = 1e-6 * (np.interp(rows[:, 0], pairs[:, 0], pairs[:, 1]) - rows[:, 1])
            figures[f"{topic}, latency, median [ms]"] = float(np.median(late))
            figures[f"{topic}, latency, 99 % [ms]"] = float(np.percentile(late, 99.0))
            figures[f"{topic}, not heard [1]"] = float(np.sum(np.diff(np.sort(rows[:, 2])) - 1))
    return figures


# The data collection.

NODES = {
    "robot": ("/hric_control/robot ",),
    "motion capture client": ("/natnet_client ",),
    "EMG and plate": ("/hric_perception/emg ", "/hric_perception/force_plate "),
    "synchroniser": ("/hric_perception/synchronizer ",),
    "emulated sensors": ("emulated_",),
    "recorder": ("/recorder ", "bag_recorder"),
}


def measure_collection(seconds: float, rounds: int) -> list[Figures]:
    """Measure data collections in bring-ups."""
    return [collect(seconds) for _ in range(rounds)]


def collect(seconds: float) -> Figures:
    """Measure one data collection in a bring-up."""
    from live_system import LiveSystem
    from test_data_collection import shortened

    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        experiment = shortened(folder, seconds)
        words = ("env:=sim", "rviz:=false", f"experiment:={experiment}", "mocap_server:=127.0.7.13")
        system = LiveSystem(folder, *words)
        stack.callback(system.close)
        heard = folder / "heard.npz"
        listener = subprocess.Popen([sys.executable, __file__, "--listen", str(heard)], env=system.environment)
        stack.callback(listener.kill)
        system.wait_output("setpoints")
        time.sleep(1.0)
        used, begin, end = used_by(system, seconds - 4.0)
        if system.wait(seconds + 120.0):
            raise RuntimeError(system.output)
        listener.send_signal(signal.SIGINT)
        listener.wait(20.0)
        metrics = json.loads((system.run_folder / "metrics.json").read_text())
        with np.load(heard) as content:
            pairs = content["pairs"]
        robot_time = float(np.diff(np.interp([begin, end], 1e-9 * pairs[:, 0], 1e-9 * pairs[:, 1]))[0])
        figures = {OTHERS: 100.0 * used.pop(OTHERS) / (end - begin)}
        figures |= {f"{kind}, CPU per robot time [%]": 100.0 * spent / robot_time for kind, spent in used.items()}
        figures["real-time factor [1]"] = metrics["real_time_factor"]
        for topic, source in metrics["sources"].items():
            figures[f"{topic}, samples lost [1]"] = source["lost"] or 0
        figures["instants missing [1]"] = sum(stream["missing"] for stream in metrics["sync"].values())
        return figures | latencies(heard)


def used_by(system: Any, seconds: float) -> tuple[Figures, float, float]:
    """Return the processor time of the nodes over an interval [s], and its start and end on the monotonic clock [s]."""
    lines = system.processes()
    pids = {kind: [pid for pid, line in lines.items() if any(word in line for word in NODES[kind])] for kind in NODES}

    def used() -> Figures:
        shares = {kind: sum(map(processor_time, found)) for kind, found in pids.items()}
        return shares | {ALL: sum(shares.values()), OTHERS: busy_time() - sum(shares.values())}

    before, begin = used(), time.monotonic()
    time.sleep(seconds)
    after, end = used(), time.monotonic()
    return {kind: after[kind] - before[kind] for kind in before}, begin, end


def table(rounds: Sequence[Figures]) -> str:
    """Return a table with median, lowest and highest value of the rounds."""
    lines = ["| | median | lowest | highest |", "|---|---|---|---|"]
    for key in rounds[0]:
        values = [figures[key] for figures in rounds if key in figures]
        lines.append(f"| {key} | {statistics.median(values):.4g} | {min(values):.4g} | {max(values):.4g} |")
    return "\n".join(lines)


MEASURES: dict[str, Callable[[float, int], list[Figures]]] = {
    "loop": measure_loop,
    "panda": functools.partial(measure_real, "panda"),
    "fr3": functools.partial(measure_real, "fr3"),
    "collection": measure_collection,
}


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=MEASURES)
    parser.add_argument("--seconds", type=float, default=5.0, help="duration of each run [s]")
    parser.add_argument("--rounds", type=int, default=10)
    chosen = parser.parse_args()
    rounds = MEASURES[chosen.what](chosen.seconds, chosen.rounds)
    print(f"{len(rounds)} rounds, load now {os.getloadavg()[0]:.1f}\n{table(rounds)}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--robot"]:
        run_robot(float(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]), sys.argv[5] == "real")
    elif sys.argv[1:2] == ["--listen"]:
        listen(Path(sys.argv[2]))
    else:
        main()
