"""Simulated human who guides an arm through libfranka and the emulated control box, compared with the simulation."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import yaml
from live_system import ROOT, LiveSystem
from rosbags.highlevel import AnyReader

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from hric_bags.reader import seconds

pytestmark = [pytest.mark.alone, pytest.mark.live]

Start = Callable[..., LiveSystem]
Figure = Callable[[str, float, str], None]
FloatArray = npt.NDArray[np.float64]
HUMAN = "/hric/human"
EXPERIMENT = ROOT / "src/hric_experiments/config/experiments/hand_guidance.yaml"
HANDLE = [0.113, 0.0, 0.04, 1.0]
"""Homogeneous position of the handle, at which the person holds the robot's hand, in axes of the hand [m]."""
CYCLE = 1e-3
"""Duration of a cycle [s]; a message of a grip has the load of the previous cycle."""
FAST = 0.02
"""Speed of the handle above which its position allows to estimate a time [m/s]."""
MOTION = 3.0
"""Duration of the person's motion that both runs contain, even on a busy machine [s of the arm's time]."""


@dataclass
class Led:
    """Joint positions over the arm's time, and the grip, from a bag.

    Attributes:
        time, stamp, q: arm's time (n,) [s], run's time (n,) [s], and joint positions (n, 7) [rad] of each cycle.
        start: time at which the person starts to move, in the arm's time [s].
        grip_stamp, point, force, closed: values of each message of the grip: (m,) [s], (m, 3) [m], (m, 3) [N], (m,).
    """

    time: FloatArray
    stamp: FloatArray
    q: FloatArray
    start: float
    grip_stamp: FloatArray
    point: FloatArray
    force: FloatArray
    closed: npt.NDArray[np.bool_]


def led(bag: Path) -> Led:
    """Read a bag."""
    messages: dict[str, list[Any]] = {"/control_log": [], f"{HUMAN}/grip": [], f"{HUMAN}/events": []}
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages([item for item in reader.connections if item.topic in messages]):
            messages[connection.topic].append(reader.deserialize(raw, connection.msgtype))
    log, grips, events = messages.values()
    time = np.concatenate([message.time for message in log])
    stamp = np.concatenate([seconds(message.header.stamp) + message.time - message.time[0] for message in log])
    (started,) = (seconds(event.header.stamp) for event in events if event.kind == "started")
    return Led(
        time,
        stamp,
        np.concatenate([message.position.reshape(-1, 7) for message in log]),
        float(np.interp(started, stamp, time)),
        np.array([seconds(message.header.stamp) for message in grips]),
        np.array([[message.point.x, message.point.y, message.point.z] for message in grips]),
        np.array([[getattr(message.wrench.force, axis) for axis in "xyz"] for message in grips]),
        np.array([message.closed for message in grips]),
    )


def lateness(run: Led) -> FloatArray:
    """Return the time shift of each message of the grip during motion [s].

    It is the time at which the arm was at the position in the message, minus the stamp of the message.
    """
    model = KdlFrankaModel(panda_description.load(), "panda")
    c = np.sqrt(0.5)
    p_flange_handle = np.array([[c, c, 0, 0], [-c, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) @ HANDLE
    point = np.array([(np.asarray(model.pose(FrankaFrame.FLANGE, list(q))) @ p_flange_handle)[:3] for q in run.q])
    velocity = np.gradient(point, run.time, axis=0)
    within = run.closed & (run.grip_stamp > run.stamp[0]) & (run.grip_stamp < run.stamp[-1])
    rows = np.searchsorted(run.stamp, run.grip_stamp[within])
    v, off = velocity[rows], run.point[within] - point[rows]
    fast = np.linalg.norm(v, axis=1) > FAST
    shift: FloatArray = (off * v).sum(axis=1)[fast] / (v * v).sum(axis=1)[fast]
    return run.stamp[rows][fast] + shift - run.grip_stamp[within][fast]


def test_through_libfranka_the_human_leads_the_arm_as_in_the_simulation_and_their_stamps_are_the_arms(
    start: Start, tmp_path: Path, figure: Figure
) -> None:
    content = yaml.safe_load(EXPERIMENT.read_text()) | {"duration": 4.5}
    (tmp_path / "led.yaml").write_text(yaml.safe_dump(content))
    runs = []
    for environment in (["env:=sim", "real_time_factor:=0.5"], ["env:=real", "robot_ip:=emulated"]):
        system = start(*environment, "simulator:=mujoco", "rviz:=false", f"experiment:={tmp_path / 'led.yaml'}")
        assert system.wait(180.0) == 0, system.output
        assert system.processes() == {} and "Traceback" not in system.output, system.output
        folder = system.run_folder
        assert yaml.safe_load((folder / "run.yaml").read_text())["status"] == "completed"
        assert "grip guide of panda_hand" in (folder / "summary.txt").read_text()
        runs.append(led(next(folder.glob("*.bag"))))
    simulated, behind = runs
    assert behind.closed.any() and np.linalg.norm(behind.force[behind.closed], axis=1).max() > 1.0

    # The sensors of the emulated arm are noisy, and libfranka's filter and limiter change the torques by little.
    grid = np.arange(0.0, MOTION, 0.01)
    q, others = (
        np.array([np.interp(run.start + grid, run.time, row) for row in run.q.T]) for run in (behind, simulated)
    )
    difference = float(np.abs(q - others).max())
    figure("hand guidance, through libfranka beside the simulation: joints", 1e3 * difference, "mrad")
    assert np.ptp(others, axis=1).max() > 0.05 and difference < 1e-3

    shift = float(np.median(lateness(behind)) + CYCLE)
    figure("hand guidance, through libfranka: the human's stamps beside the arm's", 1e3 * shift, "ms")
    assert abs(float(np.median(lateness(simulated))) + CYCLE) < 1e-4, "so it is measured"
    assert abs(shift) < 2e-3
