"""A synthetic bag with each kind of data that export supports, and its contents."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from geometry_msgs.msg import Point, Quaternion, TransformStamped
from rosgraph_msgs.msg import Log
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from synthetic import log_message, signals
from tf2_msgs.msg import TFMessage

from franka_msgs.msg import FrankaState
from hric_core.robot_time.stamps import to_time
from hric_msgs.msg import MocapData, RigidBodyState, SampleChunk, SyncedSample, SyncLayout
from hric_run.bag_writer import BagWriter

CYCLES, BATCH = 400, 20
EMG_RATE, EMG_CHUNK = 2000.0, 16
PLATE_RATE, PLATE_CHUNK = 1000.0, 10
FRAMES, FRAME_PERIOD = 60, 1.0 / 240.0
HIDDEN = range(20, 30)
"""Frames in which marker hand/2 is not visible."""
MARKERS_BODY = np.array([[0.06, -0.02, 0.0], [-0.04, -0.03, 0.01], [-0.02, 0.05, 0.02]])
"""Positions of the markers in the body [m]."""
PLATE_ORIGIN = np.array([1.0, 0.2, 0.0])
"""Position of the plate in the base, with parallel axes [m]."""
WEIGHT, PRESSED = 100.0, np.array([0.1, 0.05])
"""Force that presses on the plate [N], and its point on the plate [m]."""


@dataclass(frozen=True)
class Truth:
    """Contents of the bag.

    Attributes:
        bag: its path.
        log: time (n,), position (n, 3), velocity (n, 3).
        emg: samples, shape (n, 2).
        p, R: poses of the body in the stream's frame, shape (k, 3), (k, 3, 3).
    """

    bag: Path
    log: tuple[np.ndarray, np.ndarray, np.ndarray]
    emg: np.ndarray
    p: np.ndarray
    R: np.ndarray


def write(path: Path, mocap_frame: str = "mocap") -> Truth:
    """Write the bag."""
    data = signals(CYCLES, 0.05)
    emg = np.random.default_rng(1).normal(size=(800, 2))
    t = np.arange(FRAMES) * FRAME_PERIOD
    p = np.column_stack([0.5 + 0.1 * np.sin(6 * t), 0.3 * np.cos(5 * t), 0.4 + 0.2 * t])
    R = Rotation.from_rotvec(np.column_stack([0.5 * np.sin(7 * t), t, 0.3 * np.cos(4 * t)])).as_matrix()
    with BagWriter(path) as bag:
        bag.write("/tf_static", _plate_frame(), 0.0)
        bag.write("/hric/perception/sync_layout", _layout(), 0.0)
        for first in range(0, CYCLES, BATCH):
            bag.write("/control_log", log_message(first, BATCH, data), float(data[0][first + BATCH - 1]))
        for first in range(0, len(emg), EMG_CHUNK):
            bag.write("/hric/perception/emg/raw", _emg(first, emg), first / EMG_RATE)
        for first in range(0, 400, PLATE_CHUNK):
            bag.write("/hric/perception/force_plate/left/samples", _plate(first), first / PLATE_RATE)
        for k in range(FRAMES):
            bag.write("/hric/perception/mocap", _frame(k, p[k], R[k], mocap_frame), float(t[k]))
        for k in range(40):
            bag.write("/hric/perception/sync", _synced(k), k * 0.01)
            bag.write("/joint_states", _joints(k), k * 0.01)
        bag.write("/note", String("one, with a comma"), 0.1)
        bag.write("/rosout", Log(file="a.py", line=3, msg='said "so",\non two lines # and more'), 0.1)
        for k in range(3):
            state = FrankaState(time=100.0 + k)
            state.header.stamp = to_time(0.5 * k)
            bag.write("/franka_states", state, 0.5 * k)
    return Truth(path, data, emg, p, R)


def _plate_frame() -> TFMessage:
    transform = TransformStamped(child_frame_id="plate_left")
    transform.header.frame_id = "base"
    transform.transform.translation.x, transform.transform.translation.y, transform.transform.translation.z = (
        PLATE_ORIGIN.tolist()
    )
    transform.transform.rotation.w = 1.0
    return TFMessage([transform])


def _layout() -> SyncLayout:
    sources = ["/joint_states", "/joint_states", "/hric/perception/emg/raw"]
    return SyncLayout(
        names=["q1", "q2", "biceps"], units=["rad", "rad", "V"], sources=sources, policy="resample", rate=100.0
    )


def _emg(first: int, emg: np.ndarray) -> SampleChunk:
    message = SampleChunk(source="made up", channels=["biceps", "triceps"], unit="V", rate=EMG_RATE, first_sample=first)
    message.header.stamp = to_time(first / EMG_RATE)
    message.data = emg[first : first + EMG_CHUNK].ravel().tolist()
    return message


def _plate(first: int) -> SampleChunk:
    """Return plate samples for 100 N straight down: M = p x F with F = (0, 0, -100)."""
    message = SampleChunk(
        source="made up", channels=["Fx", "Fy", "Fz", "Mx", "My", "Mz"], unit="N N N N m N m N m", rate=PLATE_RATE
    )
    message.header.stamp, message.header.frame_id, message.first_sample = (
        to_time(first / PLATE_RATE),
        "plate_left",
        first,
    )
    message.data = [0.0, 0.0, -WEIGHT, -WEIGHT * PRESSED[1], WEIGHT * PRESSED[0], 0.0] * PLATE_CHUNK
    return message


def _frame(k: int, p: np.ndarray, R: np.ndarray, frame: str) -> MocapData:
    message = MocapData(frame_number=k, tracking_valid=True, latency=0.005)
    message.header.stamp, message.header.frame_id = to_time(k * FRAME_PERIOD), frame
    body = RigidBodyState(name="hand", id=1, tracking_valid=True)
    body.pose.position, body.pose.orientation = (
        Point(*p.tolist()),
        Quaternion(*Rotation.from_matrix(R).as_quat().tolist()),
    )
    message.rigid_bodies = [body]
    for m, point in enumerate(MARKERS_BODY, 1):
        if m == 2 and k in HIDDEN:
            continue
        message.labelled_marker_names.append(f"hand/{m}")
        message.labelled_markers.append(Point(*(p + R @ point).tolist()))
    message.marker_sizes = [0.014] * len(message.labelled_markers)
    return message


def _synced(k: int) -> SyncedSample:
    message = SyncedSample(values=[0.1 * k, -0.1 * k, 1.0], age=[0.001, 0.0005], valid=[True, k > 0])
    message.header.seq, message.header.stamp = k, to_time(k * 0.01)
    return message


def _joints(k: int) -> JointState:
    message = JointState(name=["a", "b"], position=[0.01 * k, 0.02 * k], velocity=[1.0, 2.0])
    message.header.stamp = to_time(k * 0.01)
    return message
