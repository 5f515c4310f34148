"""Make the template of the skin from MakeHuman's base mesh: python3 -m hric_skin.make_template BODY.npz PERSON.npz.

BODY.npz has six shapes of the base mesh hm08 with joint centres and the weights of its default rig, as vertices,
triangles, bones (docs/licences.md says where they come from; all of it is CC0 1.0). Fewer triangles are made from the
mean of the six shapes in the mesh's own posture, in which no two parts touch; each remaining vertex takes weights and
shapes from the nearest original vertex. It needs vtk, which `scripts/setup --with pictures` installs.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

from hric_core.geometry import FloatArray, homogeneous
from hric_core.geometry.transforms import rotation_about
from hric_skin.surface import smoothed
from hric_skin.template import JOINTS, LINKS, MASSES, REGIONS, UNIT, ZONES, normalised

TRIANGLES = 5990
SHARPNESS = 2.5
"""Exponent of the weights: bends that lose less volume than the rig's, and still do not fold (chosen by eye)."""
SOFTENING, SOFT, SOFT_EDGE = 12, 0.2, 0.06
"""Number of smoothings of the weights within a distance [m] of the shoulders, and width of its edge [m]: an arm
that is lifted makes no sharp fold (chosen by eye)."""
COARSE: Mapping[str, tuple[str, float]] = {
    "head": ("head", 0.7),
    "r_wrist": ("r-hand", 0.85),
    "l_wrist": ("l-hand", 0.85),
    "r_ankle": ("r-ankle", 0.6),
    "l_ankle": ("l-ankle", 0.6),
}
"""Joint and factor by which these parts are made smaller while triangles are taken away: less detail remains [1]."""
BONES: Mapping[str, Mapping[str, float]] = {
    "root": {"waist": 1.0},
    "pelvis": {"waist": 1.0},
    "spine05": {"waist": 0.85, "torso": 0.15},
    "spine04": {"waist": 0.5, "torso": 0.5},
    "spine03": {"waist": 0.15, "torso": 0.85},
    "spine02": {"torso": 1.0},
    "spine01": {"torso": 1.0},
    "breast": {"torso": 1.0},
    "clavicle": {"torso": 1.0},
    "neck01": {"torso": 0.5, "head": 0.5},
    "shoulder01": {"torso": 0.7, "shoulder_abd": 0.3},
    "upperarm01": {"shoulder_abd": 0.7, "shoulder": 0.3},
    "upperarm02": {"shoulder": 1.0},
    "lowerarm01": {"elbow_flex": 0.7, "elbow": 0.3},
    "lowerarm02": {"elbow_flex": 0.15, "elbow": 0.85},
    "wrist": {"wrist": 1.0},
    "upperleg01": {"hip_abd": 0.7, "hip": 0.3},
    "upperleg02": {"hip": 1.0},
    "lowerleg01": {"knee": 1.0},
    "lowerleg02": {"knee": 1.0},
    "foot": {"ankle": 1.0},
}
"""Links that take the place of each bone; bones of hand and toes go with wrist and ankle, all others with the head."""
CURL = {
    2: (60.0, 75.0, 45.0),
    3: (62.0, 78.0, 45.0),
    4: (65.0, 80.0, 45.0),
    5: (68.0, 80.0, 45.0),
    1: (0.0, 25.0, 30.0),
}
"""Flexion of the three joints of each finger around a handle of 35 mm [deg]; project default, by looking."""


UPPER_TRUNK = 0.529
"""Share of the upper trunk in both upper parts of the trunk (de Leva 1996, men) [1]."""
CHIN, FOREHEAD, HAIRLINE, EAR, NAPE, SHOULDER, BELT, PALM = 0.005, 0.03, 0.065, 0.085, 0.03, 0.03, 0.09, 0.03
"""Borders of regions and zones, from joints of the average man [m]; project defaults, by looking."""
JAW = 1.1
"""Slope of the border between face and neck, from the ear down to the chin [1]."""
Arrays = Mapping[str, npt.NDArray[Any]]


def main(source: Path, target: Path) -> None:
    """Write the template's file."""
    with np.load(source) as data:
        arrays = dict(data)
    shapes = {f"{sex}_{mass}": arrays[f"{sex}_{mass}"].astype(float) for sex in ("female", "male") for mass in MASSES}
    heights = {name: np.ptp(shape[:, 2]) for name, shape in shapes.items()}
    weights = _weights(arrays)
    triangles, near, offset = _fewer(arrays, shapes, weights)
    rows = [list(arrays["joint_names"]).index(name) for name in JOINTS]
    weights, out = weights[near], dict[str, Any]()
    for name, shape in shapes.items():
        out[name] = _stored(shape[near] + heights[name] * offset)
        out[f"{name}_joints"] = _stored(arrays[f"{name}_joints"][rows])
    grip = _grip(arrays, "male_averageweight")[near] / heights["male_averageweight"]
    joints = dict(zip(arrays["joint_names"], arrays["male_averageweight_joints"], strict=True))
    weights = softened(triangles, shapes["male_averageweight"][near], joints, weights)
    zones, regions = _labels(shapes["male_averageweight"][near], joints, weights)
    out |= {"triangles": triangles.astype(np.uint16), "weights": np.round(255.0 * weights).astype(np.uint8)}
    np.savez_compressed(target, zones=zones, regions=regions, grip=_stored(grip), **out)
    print(f"{target}: {len(triangles)} triangles, {len(near)} vertices, {target.stat().st_size / 1e3:.0f} kB")


def _stored(lengths: FloatArray) -> npt.NDArray[np.int16]:
    return np.round(lengths / UNIT).astype(np.int16)


def _fewer(
    arrays: Arrays, shapes: Mapping[str, FloatArray], weights: FloatArray
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], FloatArray]:
    """Return fewer triangles, the original vertex next to each of their vertices, and the offset from it.

    Triangles are taken away from the mean of all shapes with smaller head, hands and feet, so that few are spent there.
    The offset is a share of the body's height.
    """
    heights = {name: np.ptp(shape[:, 2]) for name, shape in shapes.items()}
    points = mean = np.mean([shape / heights[name] for name, shape in shapes.items()], axis=0)
    factor = np.ones((len(mean), 1))
    for link, (joint, smaller) in COARSE.items():
        row, share = list(arrays["joint_names"]).index(joint), weights[:, LINKS.index(link), None]
        centre = np.mean([arrays[f"{name}_joints"][row] / heights[name] for name in shapes], axis=0)
        points = points + (smaller - 1.0) * share * (mean - centre)
        factor += (smaller - 1.0) * share
    corners, triangles = _reduced(points, arrays["triangles"])
    near, first, flat = np.unique(cKDTree(points).query(corners)[1], return_index=True, return_inverse=True)
    fewer = flat[triangles]  # neighbours next to one original vertex become one
    fewer = fewer[np.all(fewer != np.roll(fewer, 1, axis=1), axis=1)]
    return fewer, near, (corners[first] - points[near]) / factor[near]


def _reduced(points: FloatArray, triangles: npt.NDArray[np.int32]) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return vertices and triangles of a surface after Garland and Heckbert's quadric decimation."""
    surface, corners, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    corners.SetData(numpy_to_vtk(points, deep=True))
    for triangle in triangles.tolist():
        cells.InsertNextCell(3, triangle)
    surface.SetPoints(corners)
    surface.SetPolys(cells)
    reduction = vtkQuadricDecimation()
    reduction.SetInputData(surface)
    reduction.SetTargetReduction(1.0 - TRIANGLES / len(triangles))
    reduction.VolumePreservationOn()
    reduction.Update()
    left = vtk_to_numpy(reduction.GetOutput().GetPolys().GetConnectivityArray()).reshape(-1, 3)
    used, flat = np.unique(left, return_inverse=True)
    return vtk_to_numpy(reduction.GetOutput().GetPoints().GetData())[used], flat.reshape(-1, 3)


def _bones(arrays: Arrays) -> list[tuple[str, str]]:
    """Return name and side ("r", "l", "") of each bone of the rig."""
    return [(name.partition(".")[0], name.partition(".")[2].lower()) for name in map(str, arrays["bone_names"])]


def _bone_weights(arrays: Arrays) -> FloatArray:
    """Return the weight of each bone in each vertex, shape (vertices, bones)."""
    weights = np.zeros((len(arrays["bone_index"]), len(arrays["bone_names"])))
    for indices, shares in zip(arrays["bone_index"].T, arrays["bone_weight"].T.astype(float), strict=True):
        np.add.at(weights, (np.arange(len(weights)), indices), shares)
    return normalised(weights)


def _weights(arrays: Arrays) -> FloatArray:
    """Return the weight of each link in each vertex: the four largest, sharpened, shape (vertices, links)."""
    to_links = np.zeros((len(arrays["bone_names"]), len(LINKS)))
    for row, (bone, side) in zip(to_links, _bones(arrays), strict=True):
        hand_or_foot = {"finger": "wrist", "metacarpal": "wrist", "toe": "ankle"}
        other = next((link for start, link in hand_or_foot.items() if bone.startswith(start)), "head")
        for link, share in BONES.get(bone, {other: 1.0}).items():
            row[LINKS.index(link if link in LINKS else f"{side}_{link}")] = share
    weights = _bone_weights(arrays) @ to_links
    weights[weights < np.sort(weights, axis=1)[:, -4:-3]] = 0.0
    weights = weights**SHARPNESS
    return normalised(weights)


def softened(
    triangles: npt.NDArray[np.int64], vertices: FloatArray, joints: Mapping[str, FloatArray], weights: FloatArray
) -> FloatArray:
    """Return the weights of each vertex, shape (n, links), smoothed around the shoulders, with four links each.

    Args:
        triangles: indices of vertices, shape (m, 3).
        vertices: vertices of the average man, shape (n, 3) [m].
        joints: joint centres by name, shape (3,) each [m].
        weights: shares of the links, shape (n, links).
    """
    away = np.min([np.linalg.norm(vertices - joints[f"{side}-shoulder"], axis=1) for side in "rl"], axis=0)
    share = np.clip((SOFT - away) / SOFT_EDGE, 0.0, 1.0)[:, None]
    weights = share * smoothed(triangles, weights, SOFTENING) + (1.0 - share) * weights
    weights[weights < np.sort(weights, axis=1)[:, -4:-3]] = 0.0
    return normalised(weights)


def _labels(
    vertices: FloatArray, joints: Mapping[str, FloatArray], weights: FloatArray
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Return zone and region of each vertex of the average man."""
    by_link = np.array([LINKS[index].removeprefix("r_").removeprefix("l_") for index in np.argmax(weights, axis=1)])
    x, _, z = vertices.T
    eye, neck, front = joints["l-eye"], joints["neck"], joints["l-shoulder"][0]
    chin = joints["head"][2] - CHIN - JAW * np.maximum(x - joints["head"][0], 0.0)
    xiphion = neck[2] - UPPER_TRUNK * (neck[2] - joints["spine-3"][2])
    head, torso = by_link == "head", by_link == "torso"
    behind = x < eye[0] - EAR
    conditions = {
        "neck": head & (z < chin),
        "skull, forehead": head & ((z > eye[2] + FOREHEAD) | behind),
        "face": head,
        "abdomen": torso & (x > front) & (z < xiphion),
        "chest": torso & (x > front) & (z < joints["l-shoulder"][2] + SHOULDER),
        "back, shoulders": torso,
        "pelvis": by_link == "waist",
        "upper arm, elbow": np.isin(by_link, ("shoulder", "shoulder_abd")),
        "lower arm, wrist": np.isin(by_link, ("elbow", "elbow_flex")),
        "hand, fingers": by_link == "wrist",
        "thigh, knee": np.isin(by_link, ("hip", "hip_abd")),
        "lower leg": by_link == "knee",
    }
    regions = np.select(list(conditions.values()), [REGIONS.index(name) for name in conditions], 0)
    hair = head & ((z > eye[2] + HAIRLINE) | (behind & (z > joints["head"][2] - CHIN + NAPE)))
    legs = np.isin(by_link, ("waist", "hip", "hip_abd", "knee")) | (torso & (z < joints["pelvis"][2] + BELT))
    legs &= z < joints["pelvis"][2] + BELT
    zones = np.select(
        [hair, head | (by_link == "wrist"), by_link == "ankle", legs],
        [ZONES.index(name) for name in ("hair", "skin", "shoes", "trousers")],
        ZONES.index("shirt"),
    )
    return zones.astype(np.uint8), regions.astype(np.uint8)


def _grip(arrays: Arrays, name: str) -> FloatArray:
    """Return the displacement of each vertex when both hands close, shape (vertices, 3) [m]."""
    vertices = arrays[name].astype(float)
    joints = dict(zip(map(str, arrays["joint_names"]), arrays[f"{name}_joints"].astype(float), strict=True))
    weights, bones = _bone_weights(arrays), [f"{bone}.{side}" for bone, side in _bones(arrays)]
    moved = np.zeros_like(vertices)
    for side in "rl":
        middle, wrist = joints[f"{side}-finger-3-1"], joints[f"{side}-hand"]
        normal = np.cross(middle - wrist, joints[f"{side}-finger-2-1"] - joints[f"{side}-finger-5-1"])
        normal *= np.sign(normal @ (joints[f"{side}-finger-1-4"] - middle))  # out of the palm
        palm = middle + 0.4 * (wrist - middle) + PALM * normal / np.linalg.norm(normal)
        for finger, angles in CURL.items():
            T = np.eye(4)
            for number, angle in enumerate(angles, start=1):
                at, after = (joints[f"{side}-finger-{finger}-{k}"] for k in (number, number + 1))
                axis = np.cross(after - at, normal if finger > 1 else palm - at)
                R = rotation_about(axis / np.linalg.norm(axis), np.radians(angle))
                T = T @ homogeneous(R, at - R @ at)
                share = weights[:, bones.index(f"finger{finger}-{number}.{side}")]
                moved += share[:, None] * (vertices @ T[:3, :3].T + T[:3, 3] - vertices)
    return moved


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
