"""A synthetic run with known numbers: three joints, first-order moves, a bag as of a robot."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import Float64MultiArray

from control_msgs.msg import JointTrajectoryControllerState
from hric_bags.run_folder import RunFolder
from hric_core.robot_time.stamps import to_time
from hric_msgs.msg import ControlLog, JointLimitCounts
from hric_run.bag_writer import BagWriter

JOINTS = ("j1", "j2", "j3")
START = np.array([0.0, 0.2, 0.0])
TARGET = np.array([1.0, 0.2, -0.5])
PERIOD, BATCH, TIME_CONSTANT = 1e-3, 20, 0.1


def signals(cycles: int, sent_at: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (n,), position (n, 3) and velocity (n, 3) of exponential moves that start at `sent_at`."""
    time = np.arange(cycles) * PERIOD
    moved = 1.0 - np.exp(-np.maximum(time - sent_at, 0.0) / TIME_CONSTANT)
    position = START + moved[:, None] * (TARGET - START)
    return time, position, np.gradient(position, PERIOD, axis=0)


def log_message(first: int, count: int, data: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Any:
    """Return a control log of `count` cycles from `first` on; joint 1's command before limiting is twice that after."""
    time, position, velocity = (values[first : first + count] for values in data)
    command = position * 10.0
    raw = command * np.array([2.0, 1.0, 1.0])
    arrays = {"position": position, "velocity": velocity, "effort": command, "command_raw": raw, "command": command}
    message = ControlLog(
        joint_names=list(JOINTS),
        command_interface=["effort"] * 3,
        first_cycle=first,
        n_cycles=count,
        time=time.tolist(),
    )
    for name, values in arrays.items():
        setattr(message, name, values.ravel().tolist())
    message.header.stamp = to_time(float(time[0]))
    return message


def counts_message(time: float) -> Any:
    """Return limit counts in which joint 2 was limited by velocity and joint 3 began outside its range."""
    message = JointLimitCounts(
        joint_names=list(JOINTS),
        cycles=100,
        position=[0, 0, 0],
        velocity=[0, 7, 0],
        effort=[0, 0, 0],
        effort_rate=[0, 0, 0],
    )
    message.velocity_ratio_max, message.position_excess_max, message.started_outside = (
        [0.5, 1.2, 0.1],
        [0.0, 0.0, 0.03],
        [False, False, True],
    )
    message.header.stamp = to_time(time)
    return message


def write_run(
    root: Path,
    cycles: int = 2000,
    sent_at: float = 0.1,
    lost: tuple[int, ...] = (),
    twice: tuple[int, ...] = (),
    extra: Sequence[tuple[str, Any, float]] = (),
) -> RunFolder:
    """Write a run folder; lost, twice: batches of 20 cycles left out, or written twice; extra: more messages."""
    folder = RunFolder.create(root, "made_up")
    data = signals(cycles, sent_at)
    with BagWriter(folder.bag_path) as bag:
        for batch in range(cycles // BATCH):
            message = log_message(batch * BATCH, BATCH, data)
            stamp = float(data[0][(batch + 1) * BATCH - 1])
            for _ in range(0 if batch in lost else 2 if batch in twice else 1):
                bag.write("/control_log", message, stamp)
            if abs(stamp - sent_at) < BATCH * PERIOD / 2:
                bag.write("/pd/command", Float64MultiArray(data=TARGET.tolist()), sent_at)
                bag.write("/pd/state", _state(stamp), stamp)
        for topic, message, stamp in extra:
            bag.write(topic, message, stamp)
        bag.write("/limit_counts", counts_message(cycles * PERIOD), cycles * PERIOD)
    limits = {
        name: {"lower": -2.0, "upper": 2.0, "velocity": 20.0, "effort": 20.0, "effort_rate": 1000.0} for name in JOINTS
    }
    run = {"experiment": "made_up", "description": "made up", "status": "completed", "mode": "headless"}
    folder.write({**run, "bag": folder.bag_path.name, "limits": limits})
    return folder


def _state(time: float) -> Any:
    message = JointTrajectoryControllerState(joint_names=list(JOINTS))
    message.desired.positions = START.tolist()
    message.header.stamp = to_time(time)
    return message
