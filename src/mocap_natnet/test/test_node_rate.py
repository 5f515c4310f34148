"""The node at 1000 frames per second for a minute."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from real_master import free_port, ros, roscore

from hric_msgs.msg import MocapData

sys.path.insert(0, str(Path(__file__).parent))
from motive_process import motive

__all__ = ["ros", "roscore"]
pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]
NODE = Path(__file__).parents[1] / "nodes" / "natnet_client"
SECONDS = float(os.environ.get("HRIC_MOCAP_SECONDS", "60"))
RATE = 1000


@pytest.mark.live
def test_no_frame_of_a_thousand_per_second_is_lost_in_a_minute(ros: str) -> None:
    import rospy

    command, data = free_port(), free_port()
    numbers: list[int] = []
    rospy.Subscriber(
        "/hric/perception/mocap",
        MocapData,
        lambda message: numbers.append(message.frame_number),
        queue_size=None,
        tcp_nodelay=True,
    )
    node = subprocess.Popen([sys.executable, str(NODE), f"_command_port:={command}", "_local:=127.0.0.1"])
    try:
        with motive("--rate", str(RATE), "--command-port", str(command), "--data-port", str(data), "--noise", "1e-4"):
            end = time.monotonic() + 30
            while len(numbers) < RATE:
                assert time.monotonic() < end, "no frames"
                time.sleep(0.1)
            time.sleep(SECONDS)
    finally:
        node.send_signal(signal.SIGINT)
        node.wait(20)
    time.sleep(0.5)
    assert len(numbers) > 0.9 * RATE * SECONDS
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
