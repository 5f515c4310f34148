"""A synthetic run of the real Panda with everything that a page shows: sensors, markers, frames, synchroniser, log
and diagnostics."""

from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PoseStamped, TransformStamped, WrenchStamped
from rosgraph_msgs.msg import Log
from std_msgs.msg import Float64MultiArray, String
from tf2_msgs.msg import TFMessage

import panda_description
from hric_bags.run_folder import RunFolder
from hric_core.robot_time.stamps import to_time
from hric_msgs.msg import (
    ControlLog,
    MocapData,
    RigidBodyState,
    SampleChunk,
    SourceCount,
    SyncedSample,
    SyncLayout,
    SyncStatus,
)
from hric_run.bag_writer import BagWriter

ARM = tuple(f"panda_joint{k}" for k in range(1, 8))
JOINTS = (*ARM, "panda_finger_joint1", "panda_finger_joint2")
BEGIN = np.array([0.0, -0.4, 0.0, -1.6, 0.0, 1.2, 0.0, 0.0, 0.0])
END = np.array([0.8, 0.2, 0.3, -2.2, 0.2, 1.9, 0.8, 0.03, 0.03])
CYCLES, BATCH, CHANNELS = 2000, 100, 4
SOURCES = {"emg": 2000.0, "plate": 1000.0}
"""Sensors whose messages are numbered, and their rates [Hz]."""
NASTY = "</script><script>document.title = 'broken'</script>"
"""Log message with characters that are special in HTML."""


def positions(time: np.ndarray) -> np.ndarray:
    """Return positions of all joints, shape (n, 9) [rad, m]: half a period of a cosine from BEGIN to END."""
    return BEGIN + 0.5 * (1.0 - np.cos(np.pi * time / (CYCLES * 1e-3)))[:, None] * (END - BEGIN)


def write_run(root: Path, name: str = "made_up_panda", scale: float = 1.0) -> RunFolder:
    """Write a run folder with bag, description and run.yaml; `scale`: factor of the motion for the same setpoint."""
    folder = RunFolder.create(root, name)
    folder.urdf_path.write_text(panda_description.load(hand=True))
    time = np.arange(CYCLES) * 1e-3
    q = BEGIN + scale * (positions(time) - BEGIN)
    with BagWriter(folder.bag_path) as bag:
        bag.write("/tf_static", _static(), 0.0)
        bag.write("/pd/command", Float64MultiArray(data=END.tolist()), 0.2)
        for first in range(0, CYCLES, BATCH):
            stamp = float(time[first])
            bag.write("/control_log", _log(first, time, q), stamp)
            bag.write("/hric/perception/emg/raw", _chunk(first, stamp), stamp)
            bag.write("/hric/perception/force_plate/1/samples", _plate(first, stamp), stamp)
            for source, rate in SOURCES.items():
                following = round((first + BATCH) * rate / 1000.0)
                count = SourceCount(source=source, counts="samples", next=following, sent=following, rate=rate)
                bag.write("/hric/perception/sent", _stamped(count, stamp + (BATCH - 1) * 1e-3), stamp)
        for k in range(0, CYCLES, 10):
            _sensors(bag, float(time[k]))
        _words(bag)
    limits = {
        joint: {"lower": -2.9, "upper": 2.9, "velocity": 2.2, "effort": 87.0, "effort_rate": 1000.0} for joint in JOINTS
    }
    run = {
        "experiment": name,
        "description": "made up",
        "status": "completed",
        "mode": "headless",
        "bag": folder.bag_path.name,
        "interval": [0.05, 1.95],
    }
    definition = {"robot": {"hw": "made/Up"}, "parameters": {"pd": {"kp": 50.0 * scale}}}
    folder.write({**run, "limits": limits, "definition": definition, "parameters": {"pd": {"joints": list(JOINTS)}}})
    return folder


def _stamped(message: Any, time: float, frame: str = "") -> Any:
    message.header.stamp = to_time(time)
    message.header.frame_id = frame
    return message


def _log(first: int, time: np.ndarray, q: np.ndarray) -> Any:
    part = slice(first, first + BATCH)
    message = ControlLog(
        joint_names=list(JOINTS), command_interface=["effort"] * len(JOINTS), first_cycle=first, n_cycles=BATCH
    )
    message.time = time[part].tolist()
    for name in ("position", "velocity", "effort", "command_raw", "command"):
        setattr(message, name, q[part].ravel().tolist())
    return _stamped(message, float(time[first]))


def _chunk(first: int, time: float) -> Any:
    """Return EMG with a time code, as an emulated device sends it."""
    samples = np.arange(2 * first, 2 * (first + BATCH))
    bursts = 0.5 * (1.0 - np.cos(samples[:, None] * 0.004 + np.arange(CHANNELS)))
    data = np.column_stack([1e-3 * bursts * np.sin(samples[:, None] * np.linspace(0.5, 1.1, CHANNELS)), samples / 2e3])
    return _stamped(
        SampleChunk(
            source="emg",
            channels=[*(f"muscle {k}" for k in range(CHANNELS)), "time"],
            unit=" ".join([*["V"] * CHANNELS, "s"]),
            rate=SOURCES["emg"],
            first_sample=2 * first,
            data=data.ravel().tolist(),
        ),
        time,
    )


def _plate(first: int, time: float) -> Any:
    samples = np.arange(first, first + BATCH)
    return _stamped(
        SampleChunk(
            source="plate",
            channels=["Fx", "Fz", "Mx", "time"],
            unit="N N N m s",
            rate=SOURCES["plate"],
            first_sample=first,
            data=np.column_stack([np.tile([1.0, 2.0, 3.0], (BATCH, 1)), samples / 1e3]).ravel().tolist(),
        ),
        time,
    )


def _static() -> Any:
    """Return the static transforms: motion capture 0.5 m in front of the base, turned by 90 degrees about z; plate
    0.6 m in front of it."""
    transform = _stamped(TransformStamped(child_frame_id="mocap"), 0.0, "panda_link0")
    transform.transform.translation.x = 0.5
    transform.transform.rotation.z = transform.transform.rotation.w = np.sqrt(0.5)
    plate = _stamped(TransformStamped(child_frame_id="force_plate_1"), 0.0, "panda_link0")
    plate.transform.translation.x, plate.transform.translation.z, plate.transform.rotation.w = 0.6, 0.05, 1.0
    return TFMessage(transforms=[transform, plate])


def _sensors(bag: BagWriter, time: float) -> None:
    hand = RigidBodyState(name="hand", tracking_valid=time > 0.5)
    hand.pose.position = Point(0.1, 0.2 + 0.1 * time, 0.3)
    hand.pose.orientation.w = 1.0
    markers = [Point(0.1, 0.2 + 0.1 * time, 0.3), Point(0.15, 0.2 + 0.1 * time, 0.3)]
    frame = MocapData(
        rigid_bodies=[hand],
        labelled_marker_names=["hand/a", "hand/b"],
        labelled_marker_ids=[1, 2],
        labelled_markers=markers,
    )
    bag.write("/hric/perception/mocap", _stamped(frame, time, "mocap"), time)
    pose = PoseStamped()
    pose.pose.position.x, pose.pose.orientation.w = 0.6, 1.0
    bag.write("/hric/human/hand", _stamped(pose, time, "panda_link0"), time)
    wrench = WrenchStamped()
    wrench.wrench.force.x, wrench.wrench.force.z = 10.0, -50.0 * time
    bag.write("/hric/perception/force_plate/1/wrench", _stamped(wrench, time), time)
    synced = SyncedSample(values=[1.0, time - 1e-4], age=[0.001, 0.004], valid=[True, time > 1.0])
    bag.write("/hric/perception/sync", _stamped(synced, time), time)


def _words(bag: BagWriter) -> None:
    layout = SyncLayout(
        names=["a", "/emg.data[time]"],
        sources=["/joint_states", "/emg"],
        units=["", ""],
        interpolations=["linear", "hold"],
        policy="resample",
        rate=100.0,
    )
    bag.write("/hric/perception/sync_layout", layout, 1.9)
    status = SyncStatus(
        sources=["/joint_states", "/emg"],
        starving=[False, True],
        reasons=["", "nothing since 1 s"],
        sent=200,
        incomplete=100,
    )
    for name, value in (
        ("samples", 200),
        ("rate", 100.0),
        ("refused", 0),
        ("late", 0),
        ("skew_mean", 0.001),
        ("skew_max", 0.002),
    ):
        setattr(status, name, [value, value])
    bag.write("/hric/perception/sync_status", _stamped(status, 1.9), 1.9)
    bag.write("/rosout", _stamped(Log(level=Log.WARN, name="/node", msg=NASTY), 1.0), 1.0)
    bag.write("/rosout", _stamped(Log(level=Log.INFO, name="/node", msg="of no interest"), 1.0), 1.0)
    bag.write("/hric/human/phase", String("approach"), 0.7)
    ill = DiagnosticStatus(level=DiagnosticStatus.ERROR, name="emg", message="no samples")
    bag.write("/diagnostics", _stamped(DiagnosticArray(status=[ill]), 1.5), 1.5)
