"""Marker tracking on every backend, with the arm's internal motion generator and with the impedance controller."""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from contract_robots import BACKENDS, Boxes, connected
from driven_robot import Robot

from hric_core.geometry import Pose
from hric_msgs.msg import MarkerTrackingState
from mocap_natnet.headless import HeadlessMocap, robot_time
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher
from mocap_natnet.server import CameraFaults, Motive, MotiveSettings, SceneBody, ServedScene, Track

pytestmark = pytest.mark.alone

YAML = Path(__file__).parents[2] / "src" / "hric_bringup" / "config" / "controllers.yaml"
WAY = Track(
    [0.1, 1.4, 2.7], [Pose((0.0, 0.0, 1.0)), Pose((0.02, 0.06, 1.03)), Pose((0.0, 0.0, 1.0))], minimum_jerk=True
)
"""Motion of the marker, forth and back, starting and ending at rest; z up [m]."""
DURATION = 3.1
LAG, RMS = 0.15, {"cartesian_pose_controller": 2e-3, "cartesian_pose_impedance_controller": 4e-3}
"""Largest lag of the end effector behind the marker [s], and largest RMS error without this lag, by controller [m]."""
ALIKE = 5e-4
"""Largest difference of the motion from that on PyBullet [m]; caused by libfranka's low-pass filter of 100 Hz."""


def parameters(controller: str) -> dict[str, Any]:
    """Return the configured parameters of the controller."""
    found: dict[str, Any] = yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[controller]
    return found


class Followed:
    """Motion of a robot that follows the marker.

    Attributes:
        times: time of each cycle since the start of the stream [s].
        way: displacement of the end effector from its start in each cycle, shape (n, 3) [m].
        truth: displacement of the marker from its start, shape (n, 3) [m].
        states: states published by the controller.
        error: error of the robot; empty without an error.
    """

    def __init__(self, robot: Robot, controller: str) -> None:
        self.states: list[MarkerTrackingState] = []
        robot.node.subscribe(f"{controller}/state", MarkerTrackingState, self.states.append)
        robot.load(controller, **parameters(controller))
        robot.switch([controller], [])
        robot.run(0.05)
        publisher = MocapPublisher(robot.node, Publishing.read(robot.node.child("mocap")), robot_time)
        scene = ServedScene((SceneBody("hand", WAY),), (), CameraFaults(noise=1e-4, seed=1), "y")
        motive = Motive(MotiveSettings(latency=0.0), scene)
        streams: list[tuple[float, HeadlessMocap]] = []
        rows: list[tuple[float, list[float], tuple[float, ...]]] = []

        def cycle(time: float) -> None:
            if not streams:  # with the motion: before it, robot time goes on by itself
                streams.append((time, HeadlessMocap(motive, publisher, time)))
            begin, mocap = streams[0]
            mocap.advance(time)
            rows.append((time - begin, list(robot.hw.robot_state.O_T_EE[12:15]), WAY(time - begin).position))

        robot.run(DURATION, cycle)
        self.error = robot.hw.error
        self.times, positions, truth = (np.array(column) for column in zip(*rows, strict=True))
        self.way, self.truth = positions - positions[0], truth - truth[0]

    def lag_and_rms(self) -> tuple[float, float]:
        """Return the lag behind the marker [s], and the RMS error without this lag [m]."""
        n = len(self.way)
        errors = [
            float(np.sqrt(np.mean(np.sum((self.way[lag:] - self.truth[: n - lag]) ** 2, axis=1)))) for lag in range(300)
        ]
        lag = int(np.argmin(errors))
        return lag * 1e-3, errors[lag]

    def apart(self, other: "Followed") -> float:
        """Return the largest difference of the position from another motion at the same time, on any axis [m]."""
        same = np.column_stack([np.interp(self.times, other.times, other.way[:, axis]) for axis in range(3)])
        return float(np.abs(self.way - same).max())


@cache
def on_pybullet(controller: str) -> Followed:
    boxes = Boxes()
    with connected("pybullet", boxes) as robot:
        return Followed(robot, controller)


def cases() -> Iterator[Any]:
    """Yield pairs of controller and backend; the FR3 is a slow case, since it only has other limits than the Panda."""
    for backend in BACKENDS:
        for controller in RMS:
            yield pytest.param(
                controller, backend, marks=[pytest.mark.slow] if backend == "fr3" else [], id=f"{controller}-{backend}"
            )


@pytest.mark.parametrize(("controller", "backend"), list(cases()))
def test_a_marker_is_followed_alike_and_without_a_reflex(
    controller: str, connect: Callable[..., Robot], backend: str
) -> None:
    followed = Followed(connect(), controller)
    (lag, rms), apart = followed.lag_and_rms(), followed.apart(on_pybullet(controller))
    print(
        f"{backend}, {controller}: lag {1e3 * lag:.0f} ms, RMS {1e3 * rms:.2f} mm, apart from PyBullet "
        f"{1e3 * apart:.3f} mm"
    )
    assert followed.error == ""
    assert lag <= LAG
    assert rms <= RMS[controller]
    assert apart <= ALIKE
    assert {state.tracking for state in followed.states[5:]} <= {"waiting", "following"} and followed.states[
        -1
    ].losses == 0
    assert np.ptp(followed.way[:, 1]) > 0.05 and abs(followed.way[-1]).max() < 5e-3
