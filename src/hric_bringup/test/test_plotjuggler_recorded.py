"""Every curve of PlotJuggler's layouts is in a bag of the kind that the layout is for."""

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rosbag
from plotjuggler_names import curves, names
from real_master import ros, roscore  # noqa: F401
from recorder_rig import Node, start  # noqa: F401
from sensor_nodes import Nodes, TellsTime, nodes  # noqa: F401

from hric_bags.run_folder import RunFolder
from hric_core.command import main

pytestmark = pytest.mark.alone

LAYOUTS = Path(__file__).parents[1] / "plotjuggler"
SESSION = "plotjuggler_test"
FED = ("/joint_states", "/franka_state_controller/F_ext")
MESSAGES = 40
"""So many messages of the slowest topic are recorded."""


def missing(layout: str, bag: Path) -> list[str]:
    shown = curves(LAYOUTS / layout)
    assert shown
    return sorted(set(shown) - names(bag))


def unbatched(folder: RunFolder) -> Path:
    assert main(["export", str(folder.path), "--format", "bag", "--quiet"]) == 0
    (bag,) = (folder.path / "export" / "bag").iterdir()
    return bag


@pytest.fixture(scope="module")
def tracking(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """A short run of marker_tracking."""
    runs = tmp_path_factory.mktemp("runs")
    assert main(["run", "marker_tracking", "duration:=0.5", "--runs", str(runs), "--quiet", "--no-figures"]) == 0
    return RunFolder.open("latest", runs)


def test_every_layout_is_checked_here() -> None:
    assert {path.name for path in LAYOUTS.iterdir()} == {
        "arm.xml",
        "motion_capture.xml",
        "control_log.xml",
        "emg_force_plate.xml",
        "live.xml",
    }


@pytest.mark.parametrize("layout", ["arm.xml", "motion_capture.xml"])
def test_the_curves_of_the_robot_and_the_marker_are_in_the_bag_of_a_run(layout: str, tracking: RunFolder) -> None:
    assert missing(layout, tracking.bag_path) == []


def test_the_curves_of_the_control_log_are_in_the_unbatched_bag_of_a_run(tracking: RunFolder) -> None:
    assert missing("control_log.xml", unbatched(tracking)) == []


class Player:
    """Publishes what a bag holds of the arm, again and again."""

    def __init__(self, bag: Path) -> None:
        import rospy

        with rosbag.Bag(str(bag)) as recorded:
            self._messages = [(topic, message) for topic, message, _ in recorded.read_messages(FED)]
        self._publishers = {
            topic: rospy.Publisher(topic, type(message), queue_size=10) for topic, message in self._messages
        }
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            for topic, message in self._messages:
                self._publishers[topic].publish(message)
                self._stop.wait(0.01)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        for publisher in self._publishers.values():
            publisher.unregister()


@pytest.fixture
def arm(ros: str, tracking: RunFolder) -> Iterator[Player]:  # noqa: F811
    import rospy

    rospy.set_param("/robot_description", tracking.urdf_path.read_text())
    player, clock = Player(tracking.bag_path), TellsTime()
    yield player
    player.close()
    clock.close()


@pytest.mark.rostest
def test_the_curves_of_sensors_and_of_live_topics_are_in_what_the_recorder_records_of_the_nodes_that_send_them(
    arm: Player,
    nodes: Nodes,  # noqa: F811
    start: Callable[..., Node],  # noqa: F811
) -> None:
    import rospy

    nodes.start("emulated_emg", f"_session:={SESSION}", "_activation:={program: constant, level: 0.5}")
    nodes.start("emg", f"_lsl:={{session: {SESSION}}}")
    nodes.start("emulated_plate", f"_session:={SESSION}", "_load:={program: constant, wrench: [0, 0, -100, 0, 0, 0]}")
    nodes.start("force_plate", f"_lsl:={{session: {SESSION}}}", "_pose:={frame: panda_link0, xyz: [0.5, 0, 0]}")
    nodes.start("live_view", "_limits_rate:=0")
    plate, view = "/hric/perception/force_plate/1", "/hric/view"
    sensors = [
        "/hric/perception/emg/raw",
        "/hric/perception/emg/envelope",
        f"{plate}/samples",
        f"{plate}/wrench",
        f"{plate}/cop",
    ]
    views = [f"{view}/joints", f"{view}/arm_wrench", f"{view}/emg", f"{view}/force_plate/1/wrench"]
    counts = dict.fromkeys([*sensors, *views], 0)

    def count(_: object, topic: str) -> None:
        counts[topic] += 1

    recorder = start(topics=f"[{', '.join(counts)}]")
    recorder.wait_recording()
    subscribers = [rospy.Subscriber(topic, rospy.AnyMsg, count, callback_args=topic) for topic in counts]
    begin = time.monotonic()
    while min(counts.values()) < MESSAGES:
        assert time.monotonic() - begin < 60.0, counts
        time.sleep(0.1)
    for subscriber in subscribers:
        subscriber.unregister()
    assert recorder.call("stop").success
    folder = recorder.folder()
    assert missing("live.xml", folder.bag_path) == []
    assert missing("emg_force_plate.xml", unbatched(folder)) == []
