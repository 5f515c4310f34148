"""Template of the skin: a closed surface of a female and a male body at three masses each, with skinning weights.

The file is made by `python3 -m hric_skin.make_template`, from MakeHuman's base mesh (CC0 1.0, see docs/licences.md).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix, identity

from hric_core.geometry import FloatArray
from hric_core.resources import package_path
from hric_skin.surface import smoothed, split

FILE = "data/person.npz"
HEM = 3
"""Number of smoothings of the borders between zones."""
UNIT = 1e-4
"""Resolution of stored lengths [m]."""
MASSES = ("minweight", "averageweight", "maxweight")
"""Shapes of each sex, from light to heavy, as MakeHuman names them."""
SIDED = ("shoulder_abd", "shoulder", "elbow_flex", "elbow", "wrist", "hip_abd", "hip", "knee", "ankle")
LINKS = ("waist", "torso", "head", *(f"{side}_{name}" for side in "rl" for name in SIDED))
"""Links of the body that move the skin.

Links between the joints of one segment are among them, so that a twist of an arm or thigh spreads along it.
"""
JOINTS = (
    *("neck", "head"),
    *(
        f"{side}-{name}"
        for side in "rl"
        for name in (
            *("shoulder", "elbow", "hand", "finger-1-1", "finger-2-1", "finger-3-1", "finger-3-4", "finger-5-1"),
            *("upper-leg", "knee", "ankle", "toe-2-4"),
        )
    ),
)
"""Joint centres of the template, as MakeHuman names them; "hand" is the wrist, "upper-leg" the hip."""
ZONES = ("skin", "hair", "shirt", "trousers", "shoes")
"""Parts of the surface that differ in colour."""
REGIONS = (
    *("foot, toes, ankle", "skull, forehead", "face", "neck", "back, shoulders", "chest", "abdomen", "pelvis"),
    *("upper arm, elbow", "lower arm, wrist", "hand, fingers", "thigh, knee", "lower leg"),
)
"""Body regions of ISO/TS 15066, and the foot, which the standard does not list."""


@dataclass(frozen=True)
class SkinShape:
    """Surface of one body in the template's posture: x forward, y left, z up, soles at z = 0.

    Attributes:
        vertices: vertices, shape (n, 3) [m].
        joints: joint centres by name (`JOINTS`), each of shape (3,) [m].
    """

    vertices: FloatArray
    joints: dict[str, FloatArray]

    def blended(self, other: "SkinShape", share: float) -> "SkinShape":
        """Return the shape between this one (share 0) and another (share 1)."""
        joints = {name: a + share * (other.joints[name] - a) for name, a in self.joints.items()}
        return SkinShape(self.vertices + share * (other.vertices - self.vertices), joints)


@dataclass(frozen=True)
class SkinTemplate:
    """Template of n vertices.

    Attributes:
        triangles: indices of vertices, counter-clockwise from outside, shape (m, 3).
        weights: share of each link (`LINKS`) in the motion of each vertex, at most four links each, shape (n, links).
        zones: index into `ZONES` of each vertex, shape (n,).
        regions: index into `REGIONS` of each vertex, shape (n,).
        shapes: surfaces by sex, one for each of `MASSES`.
        grip: displacement of each vertex of a hand that closes around a handle, as share of the template's height,
            shape (n, 3) [1].
    """

    triangles: npt.NDArray[np.int32]
    weights: FloatArray
    zones: npt.NDArray[np.uint8]
    regions: npt.NDArray[np.uint8]
    shapes: dict[str, tuple[SkinShape, ...]]
    grip: FloatArray


@cache
def load() -> SkinTemplate:
    """Read the template's file."""
    with np.load(package_path("hric_skin") / FILE) as data:
        triangles, zones, mixing = _hemmed(data["triangles"].astype(np.int64), data["zones"])
        shapes = {sex: tuple(_shape(data, f"{sex}_{mass}", mixing) for mass in MASSES) for sex in ("female", "male")}
        return SkinTemplate(
            triangles.astype(np.int32),
            mixing @ normalised(data["weights"].astype(np.float64)),
            zones,
            data["regions"][np.asarray(mixing.argmax(axis=1)).ravel()],  # of the nearer vertex
            shapes,
            mixing @ data["grip"] * UNIT,
        )


def _hemmed(
    triangles: npt.NDArray[np.int64], zones: npt.NDArray[np.uint8]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint8], csr_matrix]:
    """Split the surface along smooth borders between its zones.

    Returns:
        Triangles; zone of each of the k vertices; weights of the n old vertices in each of them, shape (k, n).
    """
    likeness = smoothed(triangles, np.eye(len(ZONES))[zones], HEM)
    mixing, parts = identity(len(zones), format="csr"), list[npt.NDArray[np.int64]]()
    for zone in range(len(ZONES)):
        others = np.delete(likeness, zone, axis=1).max(axis=1)
        one = split(triangles, likeness[:, zone] - others)
        likeness, mixing, zones = one.mixing @ likeness, one.mixing @ mixing, zones[one.near]
        likeness[:, zone] = -1.0  # so that no other zone takes up the edge
        zones[one.inside] = zone
        parts.append(one.inside)
        triangles = one.outside
    return np.concatenate(parts), zones, mixing


def normalised(weights: FloatArray) -> FloatArray:
    """Return the weights of each vertex, shape (n, k), so that they add up to 1."""
    shares: FloatArray = weights / weights.sum(axis=1, keepdims=True)
    return shares


def _shape(data: Any, name: str, mixing: csr_matrix) -> SkinShape:
    joints = dict(zip(JOINTS, UNIT * data[f"{name}_joints"], strict=True))
    return SkinShape(UNIT * (mixing @ data[name]), joints)
