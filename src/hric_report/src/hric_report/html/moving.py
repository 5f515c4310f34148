"""What the replay of a run moves: the robot, markers and frames, and the force plates beside it."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hric_analysis import tracking
from hric_analysis.recordings import Moving, Signal
from hric_core import urdf
from hric_report.figure import FloatArray
from hric_report.html.run_data import RunData
from hric_report.html.scene import Plate, Robot, Track, joint_track

WORLDS = ("", "world", "map")
"""Frames taken as the robot's root where the description has no link of that name."""
BODY = "body "
"""How the name of a body of the motion capture begins."""
FLANGE, TOOL = "_link8", "_hand_tcp"
"""How the names of the links end to which the end effector is fixed, and between the fingers."""
PLATE_SIZE = (0.6, 0.4)
"""Of a force plate whose experiment does not say [m]: the default of `force_plate.size`."""


def width(data: RunData) -> int:
    """Numbers per instant of a run's replay: joints, markers and frames with their times."""
    return len(data.record.log.joint_names) + sum(int(moving.values.shape[1]) + 2 for moving in data.found.moving)


def robot(
    data: RunData, rate: float, notes: list[str], *, label: str = "", role: str = "", shift: float = 0.0
) -> Robot:
    """The robot of a run for the replay.

    Args:
        data: the run.
        rate: at most so many instants per second.
        notes: gets what a reader must know.
        label, role: as `Robot`.
        shift: is added to all times [s].
    """
    time, position = joint_track(data.record.log, rate)
    described = urdf.read(data.description)
    links, statics = set(described.links), data.found.statics
    tracks = [_track(moving, rate, links, statics, notes, shift) for moving in data.found.moving]
    return Robot(
        label,
        data.description,
        data.record.log.joint_names,
        time + shift,
        position,
        [t for t in tracks if len(t.time)],
        role,
        _tip(data, described),
        [plate for signal in data.found.signals for plate in _plates(signal, data.run, links, statics, shift)],
    )


def _tip(data: RunData, described: urdf.Robot) -> tuple[str, tuple[float, ...]] | None:
    """Link and point that leave a trail: the end effector where the bag says where it is, else the tool, the flange,
    or the last link."""
    flange, tool = (next((name for name in described.links if name.endswith(end)), None) for end in (FLANGE, TOOL))
    if flange is not None and data.followed is not None:
        return flange, tuple(data.followed.record.p_flange_ee.tolist())
    if tool is not None or flange is not None:
        return tool or flange or "", (0.0, 0.0, 0.0)
    driven = [joint.child for joint in described.joints.values() if joint.name in data.record.log.joint_names]
    return (driven[-1], (0.0, 0.0, 0.0)) if driven else None


def _plates(
    signal: Signal, run: Mapping[str, Any], links: set[str], statics: Mapping[str, Any], shift: float
) -> list[Plate]:
    """The force plate whose wrench a topic has, where its pose is known; nothing for other topics."""
    found = re.search(r"/perception/force_plate/([^/]+)/wrench$", signal.topic)
    if found is None or not signal.unit.startswith("force"):
        return []
    frame = f"force_plate_{found[1]}"
    parent, R, p = _placed(frame, links, statics)
    if frame not in statics or parent not in (*links, *WORLDS):
        return []
    size = ((run.get("definition") or {}).get("force_plate") or {}).get("size") or PLATE_SIZE
    pose = tuple(p.tolist()), tuple(R.as_quat().tolist())
    return [Plate(f"force plate {found[1]}", parent, *pose, (size[0], size[1]), signal.time + shift, signal.values)]


def _track(
    moving: Moving, rate: float, links: set[str], statics: Mapping[str, Any], notes: list[str], shift: float
) -> Track:
    """Thinned to the rate, in the frame of a link where one is known."""
    steps = np.floor((moving.time - moving.time[0]) * rate)
    _, kept = np.unique(steps, return_index=True)
    frame, R, p = _placed(moving.frame_id, links, statics)
    if frame not in links and frame not in WORLDS:
        R, p = Rotation.from_matrix(np.array(tracking.THESIS_ROTATION)), np.zeros(3)
        note = (
            f"Where the frame {moving.frame_id!r} stands is not in the bag: what it holds is drawn about the "
            "robot's root, its y axis upwards."
        )
        if note not in notes:
            notes.append(note)
    values = moving.values[kept].copy()
    values[:, :3] = R.apply(values[:, :3]) + p
    seen = ~np.isnan(values[:, 0])
    if values.shape[1] > 3 and seen.any():
        values[seen, 3:] = (R * Rotation.from_quat(_unit(values[seen, 3:]))).as_quat()
    return Track(moving.kind, moving.name, frame, moving.time[kept] + shift, values, moving.name.startswith(BODY))


def _unit(quaternions: FloatArray) -> FloatArray:
    """A message that was not filled in has the quaternion 0, which is no rotation."""
    empty = np.linalg.norm(quaternions, axis=1) < 0.5
    return np.where(empty[:, None], np.array([0.0, 0.0, 0.0, 1.0]), quaternions)


def _placed(frame: str, links: set[str], statics: Mapping[str, Any]) -> tuple[str, Rotation, FloatArray]:
    """The link in which a frame is fixed, and where: (link, rotation, translation); (frame, ...) where none is
    known."""
    name, R, p = frame, Rotation.identity(), np.zeros(3)
    for _ in range(len(statics) + 1):
        if name in links or name not in statics:
            break
        name, xyz, quaternion = statics[name]
        here = Rotation.from_quat(quaternion)
        R, p = here * R, here.apply(p) + np.array(xyz)
    return name, R, p
