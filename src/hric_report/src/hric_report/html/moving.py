"""Robot of a run for the replay, with recorded markers and frames and the force plates near it."""

import re
from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from hric_analysis import tracking
from hric_analysis.recordings import Moving, Signal
from hric_bags.run_file import RunFile
from hric_core import urdf
from hric_report.figure import FloatArray
from hric_report.html.run_data import RunData
from hric_report.html.scene import ScenePlate, SceneRobot, SceneTrack, joint_track

Statics = Mapping[str, tuple[str, list[float], list[float]]]
"""Static transforms by name of the child frame: parent, translation [m] and quaternion x y z w."""
WORLDS = ("", "world", "map")
"""Names of frames that are treated as the robot's root if the robot description has no link of that name."""
BODY = "body "
"""Prefix of the names of motion capture bodies."""
FLANGE, TOOL = "_link8", "_hand_tcp"
"""Suffixes of link names: flange, and tool centre point between the gripper's fingers."""
PLATE_SIZE = (0.6, 0.4)
"""Size of a force plate, length and width [m], if the experiment does not set `force_plate.size`."""


def width(data: RunData) -> int:
    """Return how many numbers the replay of the robot, markers and frames stores per instant."""
    return len(data.record.log.joint_names) + sum(int(moving.values.shape[1]) + 2 for moving in data.recorded.moving)


def robot(
    data: RunData, rate: float, notes: list[str], *, label: str = "", role: str = "", shift: float = 0.0
) -> SceneRobot:
    """Return the robot of a run for the replay.

    Args:
        data: run data.
        rate: maximum number of replayed instants per second [Hz].
        notes: list to which the function appends notes for the page's reader.
        label: name of the run in a page with several runs.
        role: colour role in a page with several runs.
        shift: offset added to all times [s].
    """
    time, position = joint_track(data.record.log, rate)
    described = urdf.read(data.description)
    links, statics = set(described.links), data.recorded.statics
    tracks = [_track(moving, rate, links, statics, notes, shift) for moving in data.recorded.moving]
    return SceneRobot(
        label,
        data.description,
        data.record.log.joint_names,
        time + shift,
        position,
        [t for t in tracks if len(t.time)],
        role,
        _tip(data, described),
        [plate for signal in data.recorded.signals for plate in _plates(signal, data.run, links, statics, shift)],
    )


def _tip(data: RunData, described: urdf.Robot) -> tuple[str, tuple[float, ...]] | None:
    """Return the point whose trail the replay shows, as (link, position in its frame [m]); None: no moving link.

    The point is the end effector if the bag has its offset from the flange, else the tool, flange or last moving link.
    """
    flange, tool = (next((name for name in described.links if name.endswith(end)), None) for end in (FLANGE, TOOL))
    if flange is not None and data.followed is not None:
        return flange, tuple(data.followed.record.p_flange_ee.tolist())
    if tool is not None or flange is not None:
        return tool or flange or "", (0.0, 0.0, 0.0)
    driven = [joint.child for joint in described.joints.values() if joint.name in data.record.log.joint_names]
    return (driven[-1], (0.0, 0.0, 0.0)) if driven else None


def _plates(signal: Signal, run: RunFile, links: set[str], statics: Statics, shift: float) -> list[ScenePlate]:
    """Return the force plate that belongs to a wrench topic; empty for other topics, or if its pose is unknown."""
    match = re.search(r"/perception/force_plate/([^/]+)/wrench$", signal.topic)
    if match is None or not signal.unit.startswith("force"):
        return []
    frame = f"force_plate_{match[1]}"
    parent, R, p, known = placement(frame, links, statics)
    if frame not in statics or not known:
        return []
    size = ((run.get("definition") or {}).get("force_plate") or {}).get("size") or PLATE_SIZE
    pose = tuple(p.tolist()), tuple(R.as_quat().tolist())
    return [
        ScenePlate(f"force plate {match[1]}", parent, *pose, (size[0], size[1]), signal.time + shift, signal.values)
    ]


def _track(
    moving: Moving, rate: float, links: set[str], statics: Statics, notes: list[str], shift: float
) -> SceneTrack:
    """Return a recorded motion at a reduced rate, in the frame of a robot link if the transform is known."""
    _, shown = np.unique(np.floor((moving.time - moving.time[0]) * rate), return_index=True)
    frame, R, p, known = placement(moving.frame_id, links, statics)
    if not known:
        note = (
            f"The bag has no pose of the frame {moving.frame_id!r}: its contents are drawn relative to the "
            "robot's root, with its y axis upwards."
        )
        if note not in notes:
            notes.append(note)
    values = moving.values[shown].copy()
    values[:, :3] = R.apply(values[:, :3]) + p
    seen = ~np.isnan(values[:, 0])
    if values.shape[1] > 3 and seen.any():
        values[seen, 3:] = (R * Rotation.from_quat(_unit(values[seen, 3:]))).as_quat()
    return SceneTrack(moving.kind, moving.name, frame, moving.time[shown] + shift, values, moving.name.startswith(BODY))


def _unit(quaternions: FloatArray) -> FloatArray:
    """Replace zero quaternions, as in messages without orientation, by the identity; shape (n, 4), x y z w."""
    empty = np.linalg.norm(quaternions, axis=1) < 0.5
    return np.where(empty[:, None], np.array([0.0, 0.0, 0.0, 1.0]), quaternions)


def placement(frame: str, links: set[str], statics: Statics) -> tuple[str, Rotation, FloatArray, bool]:
    """Return where a fixed frame is drawn: parent, rotation and translation [m] in it, and True if they are known.

    The parent is the nearest link, else the topmost known frame. A frame without a known pose is drawn at the robot's
    root with its y axis upwards.
    """
    name, R, p = frame, Rotation.identity(), np.zeros(3)
    for _ in range(len(statics) + 1):
        if name in links or name not in statics:
            break
        name, xyz, quaternion = statics[name]
        here = Rotation.from_quat(quaternion)
        R, p = here * R, here.apply(p) + np.array(xyz)
    if name in links or name in WORLDS:
        return name, R, p, True
    return name, Rotation.from_matrix(np.array(tracking.THESIS_ROTATION)), np.zeros(3), False
