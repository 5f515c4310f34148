"""Reader of marker tracking in a bag: motion capture frames, controller states and the true hand motion."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.parts import Bag
from hric_bags.reader import RobotTime, opened, seconds

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
FRAMES, TRUTH, PHASES = "hric/perception/mocap", "hric/human/hand", "hric/human/phase"
STATE_TYPE, ROBOT_TYPE = "hric_msgs/msg/MarkerTrackingState", "franka_msgs/msg/FrankaState"


@dataclass(frozen=True)
class CapturedFrames:
    """The n published motion capture frames.

    Attributes:
        time: middle of the exposure, robot time, shape (n,) [s].
        number: frame numbers, shape (n,).
        valid: True if the body was tracked, shape (n,).
        position: position of the body in `frame`, shape (n, 3) [m].
        latency: time from exposure to arrival, shape (n,) [s]; NaN: not known.
        body: name of the body.
        frame: reference frame of the positions.
    """

    time: FloatArray
    number: IntArray
    valid: BoolArray
    position: FloatArray
    latency: FloatArray
    body: str
    frame: str


@dataclass(frozen=True)
class States:
    """The n recorded states of the controller that follows the marker.

    Attributes:
        controller: name of the controller.
        time: robot time, shape (n,) [s].
        target, desired, measured: positions of the end effector in the base frame, shape (n, 3) [m].
        tracking: tracking state at each time, such as "following" or "lost".
        last: last state message.
    """

    controller: str
    time: FloatArray
    target: FloatArray
    desired: FloatArray
    measured: FloatArray
    tracking: tuple[str, ...]
    last: Any


@dataclass(frozen=True)
class TrackingRecord:
    """Recording of marker tracking in one bag.

    Attributes:
        frames: motion capture frames.
        states: controller states.
        truth: true hand position in the base frame: (robot time (n,) [s], position (n, 3) [m]); None: not known.
        phases: (robot time [s], phase) of the emulated human's program.
        p_flange_ee: position of the end effector in the flange frame, shape (3,) [m].
        base: name of the robot's base frame.
        own_time: stamp of each true position minus the first stamp, shape (n,) [s]; with a real robot this clock drifts
            relative to robot time.
    """

    frames: CapturedFrames
    states: States
    truth: tuple[FloatArray, FloatArray] | None
    phases: tuple[tuple[float, str], ...]
    p_flange_ee: FloatArray
    base: str
    own_time: FloatArray | None = None


def read(bag: Path | Bag, robot_time: RobotTime, body: str) -> TrackingRecord | None:
    """Read the marker tracking from a bag; None: no controller followed a marker, or no frame was received.

    Args:
        bag: the bag, or a reader of it.
        robot_time: conversion from stamps to robot time.
        body: name of the body that is followed; "": the first body of each frame.
    """
    messages: dict[str, list[tuple[float, Any]]] = {FRAMES: [], TRUTH: [], PHASES: [], STATE_TYPE: [], ROBOT_TYPE: []}
    controller = ""
    with opened(bag) as reader:
        keys = {
            c.id: key for c in reader.connections for key in messages if key == c.msgtype or c.topic.endswith(f"/{key}")
        }
        if not {FRAMES, STATE_TYPE} <= set(keys.values()):
            return None
        for connection, stamp, raw in reader.messages(connections=[c for c in reader.connections if c.id in keys]):
            key = keys[connection.id]
            if key == ROBOT_TYPE and messages[key]:
                continue
            if key == STATE_TYPE:
                controller = controller or connection.topic
                if connection.topic != controller:
                    continue
            messages[key].append((stamp * 1e-9, reader.deserialize(raw, connection.msgtype)))
    states = [message for _, message in messages[STATE_TYPE]]
    if not states or not messages[FRAMES]:
        return None
    hand = [message for _, message in messages[TRUTH]]
    robot = messages[ROBOT_TYPE]
    truth, own_time = _truth(hand, robot_time) if hand else (None, None)
    return TrackingRecord(
        _frames([message for _, message in messages[FRAMES]], robot_time, body),
        _states(controller.strip("/").split("/")[-2], states, robot_time),
        truth,
        tuple((robot_time(stamp), message.data) for stamp, message in messages[PHASES]),
        np.array(robot[0][1].F_T_EE[12:15], dtype=float) if robot else np.zeros(3),
        states[0].header.frame_id.lstrip("/"),
        own_time,
    )


def _times(messages: list[Any], robot_time: RobotTime) -> FloatArray:
    return np.array([robot_time(seconds(message.header.stamp)) for message in messages])


def _xyz(point: Any) -> tuple[float, float, float]:
    return point.x, point.y, point.z


def _truth(hand: list[Any], robot_time: RobotTime) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Return ((robot time [s], position [m]), stamp minus first stamp [s]) of the hand, sorted, without duplicates."""
    times, order = np.unique(_times(hand, robot_time), return_index=True)
    stamps = np.array([seconds(message.header.stamp) for message in hand])[order]
    return (times, np.array([_xyz(message.pose.position) for message in hand])[order]), stamps - stamps[0]


def _frames(messages: list[Any], robot_time: RobotTime, body: str) -> CapturedFrames:
    bodies = [
        next((marker_body for marker_body in message.rigid_bodies if body in ("", marker_body.name)), None)
        for message in messages
    ]
    name = body or next((marker_body.name for marker_body in bodies if marker_body is not None), "")
    return CapturedFrames(
        _times(messages, robot_time),
        np.array([message.frame_number for message in messages], dtype=np.int64),
        np.array([b is not None and bool(b.tracking_valid) for b in bodies]),
        np.array([(np.nan,) * 3 if b is None else _xyz(b.pose.position) for b in bodies]),
        np.array([message.latency for message in messages], dtype=float),
        name,
        messages[0].header.frame_id.lstrip("/"),
    )


def _positions(messages: list[Any], name: str) -> FloatArray:
    return np.array([_xyz(getattr(message, name).position) for message in messages])


def _states(controller: str, messages: list[Any], robot_time: RobotTime) -> States:
    return States(
        controller,
        _times(messages, robot_time),
        _positions(messages, "target"),
        _positions(messages, "desired"),
        _positions(messages, "measured"),
        tuple(str(message.tracking) for message in messages),
        messages[-1],
    )
