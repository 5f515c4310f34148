"""Wrong addresses and parameters, and arms that disconnect, give one clear error in time."""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from driven_robot import QUIET, Robot
from fci_peer import control_box, new_address

from franka_real import probe
from franka_real.franka_hw import FrankaHW
from hric_core.errors import HricError

pytestmark = pytest.mark.alone


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"robot_ip": ""}, "/robot/robot_ip is ''; valid: an address, e.g. 172.16.0.2, that is not empty"),
        ({"robot_ip": "127.0.9.8"}, "no Franka arm at 127.0.9.8: the machine there refuses TCP port 1337. "),
        ({"robot_ip": "no such host"}, "'no such host' is neither an IP address nor a host name"),
        ({"robot": "panda2"}, "/robot/robot is 'panda2'; valid: panda, fr3"),
        ({"cutoff_frequency": 0.0}, "/robot/cutoff_frequency is 0.0; valid: a finite number above 0 [Hz]"),
        ({"realtime_priority": 99}, "/robot/realtime_priority is 99; valid: a whole number from 0 to 98"),
        ({"rate_limiting": "yes"}, "/robot/rate_limiting is 'yes'; valid: true or false"),
        ({"collision_config": True}, "/robot/collision_config is True; valid: false, or a mapping with lower_torque_"),
        (
            {"collision_config": {"lower": [1.0]}},
            "no parameter 'lower' in /robot/collision_config; valid: lower_force_thresholds_acceleration, ",
        ),
        ({"arm_id": "left"}, "no link 'left_link0'"),
    ],
)
def test_a_wrong_parameter_is_refused_by_name(parameters, message) -> None:
    with pytest.raises(HricError, match=re.escape(message)):
        Robot(FrankaHW(), {"robot": {"robot_ip": "127.0.9.9", **QUIET, **parameters}})


def test_who_accepts_a_connection_and_then_says_nothing_is_given_up_in_time() -> None:
    with socket.socket() as mute:
        mute.bind((new_address(), probe.PORT))
        mute.listen()
        script = (
            "import sys; sys.path[:0] = sys.argv[1:2]; from driven_robot import *; from franka_real.franka_hw "
            "import FrankaHW\n"
        )
        script += 'Robot(FrankaHW(), {"robot": {"robot_ip": sys.argv[2], "connect_timeout": 0.5}})'
        command = [sys.executable, "-c", script, str(Path(__file__).parent), mute.getsockname()[0]]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30.0)
    assert done.returncode == -signal.SIGKILL
    assert "has not responded for 0.5 s" in done.stderr


def test_an_arm_that_refuses_the_connection_is_waited_for_as_long_as_asked() -> None:
    ip = new_address()
    with pytest.raises(HricError, match="refuses TCP port 1337"):
        probe.wait(ip, 1.0, 0.3)
    with socket.socket() as late:
        late.bind((ip, probe.PORT))
        starting = threading.Timer(0.5, late.listen)
        starting.start()
        probe.wait(ip, 1.0, 60.0)
        starting.join()
    with pytest.raises(HricError, match="neither an IP address nor a host name"):  # which no waiting changes
        probe.wait("no such host", 1.0, 60.0)


CLIENT = """
import sys
sys.path[:0] = sys.argv[3:]
from driven_robot import Robot
from franka_real.franka_hw import FrankaHW
robot = Robot(FrankaHW(), {"robot": {"robot_ip": sys.argv[1], "robot": sys.argv[2], "realtime_priority": 0, "lock_memory": False}})
robot.load("push", interface="effort", command=[0.0] * 7)
robot.switch(["push"], [])
robot.run(600.0, lambda time: print("moving", flush=True) if robot.hw.mode.commanded and robot.manager._loop.cycles % 500 == 0 else None)
"""  # noqa: E501


def moving_client(ip: str, kind: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", CLIENT, ip, kind, str(Path(__file__).parent)]
    client = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert client.stdout is not None and "moving" in client.stdout.readline()
    return client


@pytest.mark.parametrize("kind", ["panda", "fr3"])
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["dies", "freezes"])
def test_a_box_that_goes_away_in_a_motion_ends_the_client_with_a_word(kind, how) -> None:
    with control_box("--robot", kind, "--no-collision", ip=new_address()) as (ip, box):
        client = moving_client(ip, kind)
        began = time.monotonic()
        os.kill(box.pid, how)
        _, said = client.communicate(timeout=30.0)
        took = time.monotonic() - began
        assert client.returncode != 0
        assert "is lost" in said or "has not responded for 1.8 s" in said
        print(f"{kind}, {how.name}: ended after {took:.2f} s")
