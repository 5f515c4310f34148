"""Files of other programs, written in their layouts, with the motion of a person that is known."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from hric_core.geometry import FloatArray
from hric_core.parameters import read_yaml
from hric_human.body import Subject, describe
from hric_human.body.markers import ExtraMarker, MarkerRow
from hric_motion.formats import T_POSE, XSENS_POSE, XSENS_SEGMENTS
from hric_motion.marker_sets import FOLDER, marker_sets, plain
from hric_motion.postures import BodyPostures, MarkerPostures

RATE, FRAMES = 60.0, 60
BODY = describe(Subject(code="S07", mass=70.0, height=1.72, sex="male", parts="whole_body"))
JOINTS = list(BODY.joints)
Points = dict[str, FloatArray]


def angles() -> FloatArray:
    """Return joint angles of a person who moves arms, trunk, neck and legs, shape (n, j) [rad]."""
    t, q = np.arange(FRAMES) / RATE, np.zeros((FRAMES, len(JOINTS)))
    for column, (name, joint) in enumerate(BODY.joints.items()):
        low, high = joint.range
        wave = np.sin(2.0 * np.pi * (0.6 + 0.1 * (column % 5)) * t + column)
        q[:, column] = np.clip(np.clip(0.2, low + 0.1, high - 0.1) + 0.2 * (high - low) * wave, low + 0.02, high - 0.02)
        if name.endswith("el_flex"):
            q[:, column] += 0.5  # a straight elbow leaves the rotations of upper arm and forearm open
    return q


def points(key: str, shift: float = 0.0) -> Points:
    """Return the points of a marker set by label, z up, shape (n, 3) each [m]; shift: of the person along y [m]."""
    one, q = marker_sets()[key], angles()
    tree = read_yaml(FOLDER / f"{key}.yaml")
    labels = [label.format(side) for label in tree["labels"] for side in tree.get("sides", "LR")]
    names, extra = {label: one.known[plain(label)] for label in labels}, list(one.extra.values())
    if "Hand_left" in "".join(labels):
        for word, side, sign in zip(tree.get("sides", "LR"), ("left", "right"), (1.0, -1.0), strict=True):
            names[f"{word}Foot_left"] = name = f"{side} foot"
            extra.append(ExtraMarker(name, MarkerRow(name, "foot", (0.25, 0.25), (0.0, 14.0 * sign, 0.92)), side))
    t, R = np.arange(FRAMES) / RATE, np.tile(np.eye(3), (FRAMES, 1, 1))
    root = np.column_stack([0.3 * t, np.full(FRAMES, shift), np.full(FRAMES, 0.95)])
    p = MarkerPostures(BODY, tuple(names.values()), extra).positions(BodyPostures(R, root, q))
    return {name: p[:, column] for column, name in enumerate(names)}


def quaternions(p: Mapping[str, FloatArray], name: str, pose: Sequence[Sequence[float]]) -> FloatArray:
    """Return the orientation of a segment by its points, shape (n, 4); pose: axes forward and left in the T-pose."""
    if f"{name}_left" not in p:
        return np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 1))
    R_pose = np.array([*pose, np.cross(*np.array(pose))]).T
    forward, left = (p[f"{name}_{end}"] - p[name] for end in ("forward", "left"))
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    up = np.cross(forward, left)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return np.asarray(Rotation.from_matrix(np.stack([forward, np.cross(up, forward), up], axis=2) @ R_pose.T).as_quat())


def bones(p: Mapping[str, FloatArray]) -> list[str]:
    return [name for name in p if not name.endswith(("_forward", "_left"))]


def write_trc(path: Path, p: Points) -> Path:
    """Write points as a .trc file with y up."""
    path.parent.mkdir(parents=True, exist_ok=True)
    head = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}", "DataRate\tCameraRate\tUnits", f"{RATE:g}\t{RATE:g}\tm"]
    head += ["Frame#\tTime\t" + "\t\t\t".join(p) + "\t\t", "\t\tX1\tY1\tZ1"]
    y_up = {name: row[:, [0, 2, 1]] * [1.0, 1.0, -1.0] for name, row in p.items()}
    rows = [
        "\t".join([f"{k + 1}", f"{k / RATE:.6f}", *(f"{v:.6f}" for row in y_up.values() for v in row[k])])
        for k in range(FRAMES)
    ]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def write_motive(
    path: Path, people: Mapping[str, Points], hidden: Sequence[str] = (), units: str = "Millimeters"
) -> Path:
    """Write the bones of skeletons as a .csv file of Motive with y up; hidden: bones that are not seen in 10 frames."""
    about = "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,60.0,Export Frame Rate,60.0"
    about += f",Rotation Type,Quaternion,Length Units,{units},Coordinate Space,Global"
    head, columns = [["", "Type"], ["", "Name"], ["", "ID"], ["", ""], ["Frame", "Time (Seconds)"]], []
    for person, p in people.items():
        y_up = {name: row[:, [0, 2, 1]] * [1.0, 1.0, -1.0] for name, row in p.items()}
        for name in bones(p):
            values = np.hstack([quaternions(y_up, name, T_POSE["y"]), 1e3 * y_up[name]])
            values[20:30] = np.nan if name in hidden else values[20:30]
            columns.append(values)
            for kind, axes in (("Rotation", "XYZW"), ("Position", "XYZ")):
                for axis in axes:
                    cells = "Bone", f"{person}:{name}", "1A", kind, axis
                    for row, cell in zip(head, cells, strict=True):
                        row.append(cell)
    matrix = np.hstack(columns)
    rows = [
        ",".join([f"{k}", f"{k / RATE:.6f}", *("" if np.isnan(v) else f"{v:.6f}" for v in matrix[k])])
        for k in range(FRAMES)
    ]
    path.write_text("\n".join([about, "", *map(",".join, head), *rows]) + "\n", encoding="utf-8-sig")
    return path


def write_mvnx(path: Path, p: Points) -> Path:
    """Write the segments of a person as a .mvnx file; what the body lacks is at the pelvis."""
    pose = '<frame type="tpose"><orientation>1 0 0 0</orientation><position>0 0 0</position></frame>'
    names = "".join(f'<segment id="{k + 1}" label="{name}"/>' for k, name in enumerate(XSENS_SEGMENTS))
    place = np.hstack([p.get(name, p["Pelvis"]) for name in XSENS_SEGMENTS])
    turn = np.hstack([quaternions(p, name, XSENS_POSE)[:, [3, 0, 1, 2]] for name in XSENS_SEGMENTS])
    frames = "".join(
        f'<frame time="{1e3 * k / RATE:.0f}" index="{k}" type="normal"><orientation>{_text(turn[k])}</orientation>'
        f"<position>{_text(place[k])}</position></frame>\n"
        for k in range(FRAMES)
    )
    path.write_text(
        f'<?xml version="1.0"?><mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4"><subject label="A" frameRate='
        f'"{RATE:g}" segmentCount="23"><segments>{names}</segments><frames>{pose}{frames}</frames></subject></mvnx>'
    )
    return path


def _text(values: FloatArray) -> str:
    return " ".join(f"{value:.6f}" for value in values)


def write_handover(folder: Path, grips: Mapping[str, FloatArray]) -> Path:
    """Write a folder of two people without legs; grips: grip force of giver and taker, shape (n,) each [N]."""
    folder.mkdir(parents=True, exist_ok=True)
    for person, shift in (("giver", 0.0), ("taker", 1.2)):
        p = points("motive_skeleton", shift)
        for name in bones(p):
            if name[1:] in ("Thigh", "Shin", "Foot", "Toe"):
                continue
            file = (
                folder
                / f"{person}_{name.lower() if name in ('Hip', 'Ab', 'Chest', 'Neck', 'Head') else name}_pose_saved.csv"
            )
            _write_rows(file, "x,y,z,q0,q1,q2,q3", np.hstack([p[name], quaternions(p, name, T_POSE["z"])]))
    none = np.zeros(FRAMES)
    for name, grip in grips.items():
        _write_rows(
            folder / f"Wrench_{name}_saved.csv", "Fx,Fy,Fz,Tx,Ty,Tz", np.column_stack([none, none, -grip, *[none] * 3])
        )
    return folder


def _write_rows(path: Path, head: str, rows: FloatArray) -> None:
    np.savetxt(path, rows, fmt="%.9f", delimiter=",", header=head, comments="")
