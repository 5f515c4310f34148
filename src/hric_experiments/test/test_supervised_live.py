"""The supervisor as a node, behind motion capture over sockets: how late a slow-down is."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from hric_bags import reader as bag_reader
from hric_control.testing import free_port

WORKSPACE = Path(__file__).parents[3]
pytestmark = [pytest.mark.live, pytest.mark.alone]

EXPERIMENT = """
robot:
  hw: franka_sim/FrankaHWSim
  description: {hand: true, inertials: barycentric, damping: 0.0, friction: none}
controllers: [joint_state_controller, franka_state_controller, joint_pd_controller]
parameters:
  joint_pd_controller: {kp: 200.0, kd: 20.0, profile: {velocity: 0.5, acceleration: 2.0}}
mocap:
  stream: {rate: 240, transport: unicast, latency: 0.0055, noise: 1.0e-4, command_port: %d, data_port: %d}
  human: {program: sinusoid, begin: 0.5, centre: [1.9, 0.0, 0.5], amplitude: [0.9, 0.0, 0.0], frequency: 0.2, cycles: 4}
  base_from_mocap: {xyz: [0, 0, 0], xyzw: [0, 0, 0, 1]}
supervisor: {source: marker, hold: 0.1}
setpoints:
  - {time: 0.5, controller: joint_pd_controller, positions: [0.6, -0.4, 0, -2.2, 0, 2.0, 0.8]}
  - {time: 5.0, controller: joint_pd_controller, positions: [-0.6, -0.4, 0, -2.2, 0, 2.0, 0.8]}
  - {time: 10.0, controller: joint_pd_controller, positions: [0.6, -0.4, 0, -2.2, 0, 2.0, 0.8]}
duration: 20.0
"""


def test_a_slow_down_follows_the_marker_within_the_reaction_time_that_is_assumed(tmp_path, capsys):
    file = tmp_path / "watched.yaml"
    file.write_text(EXPERIMENT % (free_port(), free_port()))
    environment = os.environ | {
        "HRIC_RUNS": str(tmp_path / "runs"),
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
    }
    command = [str(WORKSPACE / "scripts" / "bringup"), f"experiment:={file}", "rviz:=false"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    (bag,) = (tmp_path / "runs" / "latest").glob("*.bag")
    with AnyReader([bag]) as opened:
        rows = {name: [] for name in ("/hric/safety/speed_scale_state", "/hric/safety/state")}
        chosen = [connection for connection in opened.connections if connection.topic in rows]
        for connection, _, raw in opened.messages(chosen):
            rows[connection.topic].append(opened.deserialize(raw, connection.msgtype))
    states = rows["/hric/safety/state"]
    assert {state.state for state in states} == {"free", "slowed", "stopped"}
    taken = rows["/hric/safety/speed_scale_state"]
    before, latencies = 1.0, []
    for one in taken:
        if one.requested < before:
            latencies.append(bag_reader.seconds(one.header.stamp) - bag_reader.seconds(one.request))
        before = one.requested
    median, late = np.percentile(latencies, [50, 99])
    with capsys.disabled():
        print(
            f"\nfrom the cameras to the cycle in which the arm begins to slow: median {1e3 * median:.1f} ms, "
            f"99 % {1e3 * late:.1f} ms ({len(latencies)} slow-downs)"
        )
    assert len(latencies) > 50
    assert 0.005 < median < 0.1  # the stream alone takes 5.5 ms; 0.1 s is what the protective distance assumes
