"""A simulated run beside emulated devices that the machine keeps from running: it slows down, and no sample and no
stamp suffers."""

import os
import signal
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
import rospy
from real_master import ros, roscore
from sensor_nodes import Nodes, TopicActivation, nodes, wait
from std_msgs.msg import Header

from hric_control.clock_pairs import ClockPairs
from hric_control.sim.sim_loop import SimLoop
from hric_core.robot_time import stamps
from hric_core.robot_time.progress import AHEAD, SILENT, TOPIC
from hric_core.ros import RosNode

__all__ = ["nodes", "ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
MARGIN = 0.1
"""Time by which a schedule is announced ahead, plus time that a message takes [s]."""


@pytest.fixture
def loop(ros: str) -> Iterator[SimLoop]:
    """Control loop of a robot without joints, in real time."""
    rospy.set_param("/use_sim_time", True)
    running = SimLoop(0.001, 1.0)
    pairs = ClockPairs(RosNode("/"), stamps.to_time, running)
    thread = threading.Thread(target=running.run, args=(lambda *_: True,), daemon=True)
    thread.start()
    yield running
    running.stop()
    thread.join()
    pairs.close()
    rospy.set_param("/use_sim_time", False)


def test_no_sample_is_lost_and_no_stamp_is_off_where_device_and_driver_stand_for_a_second(
    loop: SimLoop, nodes: Nodes
) -> None:
    raw, session = TopicActivation("/hric/perception/emg/raw"), f"test_waiting_{os.getpid()}"
    device = nodes.start("emulated_emg", f"_session:={session}", "_muscles:=8", "_faults:={time_code: true}")
    driver = nodes.start("emg", f"_lsl:={{session: {session}}}", "_envelope:={band: [20, 400]}")
    wait(lambda: len(raw.chunks) > 50)
    device.send_signal(signal.SIGSTOP)
    begin = loop.time
    time.sleep(1.2)
    stood = loop.time
    device.send_signal(signal.SIGCONT)
    wait(lambda: loop.time > stood + 0.5)
    driver.send_signal(signal.SIGSTOP)
    time.sleep(1.0)
    driver.send_signal(signal.SIGCONT)
    end = loop.time
    wait(lambda: raw.end > end + 0.5)
    assert "Traceback" not in nodes.end(driver) + nodes.end(device)
    raw.close()
    assert stood - begin < AHEAD + MARGIN
    numbers = np.concatenate([np.arange(chunk.first, chunk.after) for chunk in raw.chunks])
    assert np.array_equal(numbers, np.arange(numbers[0], numbers[0] + len(numbers)))
    errors = np.concatenate([chunk.times - chunk.data[:, -1] for chunk in raw.chunks])
    assert np.abs(errors).max() < 2e-4


def test_a_source_that_says_nothing_any_more_holds_the_run_for_two_seconds_and_one_that_ends_not_at_all(
    loop: SimLoop,
) -> None:
    publisher = rospy.Publisher(f"/{TOPIC}", Header, queue_size=10)
    wait(lambda: publisher.get_num_connections())
    publisher.publish(Header(stamp=stamps.to_time(loop.time), frame_id="/hung"))
    begin, began = loop.time, time.monotonic()
    wait(lambda: loop.time > begin + 2 * AHEAD)
    assert time.monotonic() - began > 0.9 * 1e-9 * SILENT
    publisher.publish(Header(stamp=stamps.to_time(loop.time), frame_id="/leaving"))
    publisher.publish(Header(frame_id="/leaving"))
    begin, began = loop.time, time.monotonic()
    wait(lambda: loop.time > begin + 3 * AHEAD)
    assert time.monotonic() - began < 0.9 * 1e-9 * SILENT
    publisher.unregister()
