"""Fit of the template to the body of a subject.

Each link moves its part of the template rigidly to its joint in the body and stretches it along the segment to the
body's length, in the template's posture: arms away from the body, elbows a little bent. Sex and mass choose the shape;
what the heaviest or lightest shape lacks, girth adds.
"""

from collections.abc import Collection
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hric_core.geometry import FloatArray, homogeneous
from hric_human.body import Body, BodySegment, describe
from hric_human.body.description import KEPT, SubjectKey
from hric_human.body.segments import SIDES
from hric_skin.skin import Skin
from hric_skin.template import LINKS, SkinShape, SkinTemplate, load

DENSITY = 1010.0
"""Mean density of a body with air in its lungs [kg/m^3]; project default, unconfirmed."""
LEAN = {link: 0.3 for link in ("head", "r_wrist", "l_wrist", "r_ankle", "l_ankle")}
"""Exponent of the girth in head, hands and feet, which grow less with the mass [1]; project default, unconfirmed."""
STEPS, EXPONENT = 4, 0.575
"""Steps to the girth of the desired volume, and exponent of each: the volume grows less than the girth squared."""


class Placed(NamedTuple):
    """Part of the template that a link moves.

    Attributes:
        R: axes of the link in the template's posture, shape (3, 3).
        p_template: the link's origin in the template, shape (3,) [m].
        scale: factors along the link's axes, shape (3,) [1].
        p_base: the same in the bind pose, in axes of `human_base`, shape (3,) [m].
    """

    R: FloatArray
    p_template: FloatArray
    scale: FloatArray
    p_base: FloatArray


def fitted(body: Body, gripping: Collection[str] = ()) -> Skin:
    """Return the skin of a body, of those segments that it has.

    Args:
        body: body of the subject. The skin of a whole body encloses the subject's mass by `DENSITY` in the bind pose.
        gripping: sides ("right", "left") whose hand is closed around a handle.
    """
    whole = describe(replace(body.subject, parts="whole_body", posture="standing"))
    template, (shape, girth) = load(), _sized(SubjectKey(whole.subject))
    present = {segment.link for segment in body.segments.values()} | {joint.child for joint in body.joints.values()}
    return _skin(template, whole, _gripping(template, shape, gripping), girth).of_links(present)


@lru_cache(maxsize=KEPT)
def _sized(key: SubjectKey) -> tuple[SkinShape, float]:
    """Return the shape of a whole body and the girth with which it encloses the subject's mass."""
    whole, template, volume = describe(key.subject), load(), key.subject.mass / DENSITY
    shapes = template.shapes[key.subject.sex]
    light, mean, heavy = shapes
    share = float(np.interp(volume, [_volume(_skin(template, whole, shape)) for shape in shapes], (-1.0, 0.0, 1.0)))
    shape, girth = mean.blended(heavy if share > 0.0 else light, abs(share)), 1.0
    for _ in range(STEPS):
        girth *= (volume / _volume(_skin(template, whole, shape, girth))) ** EXPONENT
    return shape, girth


def _volume(skin: Skin) -> float:
    return skin.volume(skin.vertices)


def _gripping(template: SkinTemplate, shape: SkinShape, sides: Collection[str]) -> SkinShape:
    """Return the shape with closed hands on some sides."""
    left = shape.vertices[:, 1:2] > 0.0
    closed = (left & ("left" in sides)) | (~left & ("right" in sides))
    return replace(shape, vertices=shape.vertices + closed * np.ptp(shape.vertices[:, 2]) * template.grip)


def _skin(template: SkinTemplate, body: Body, shape: SkinShape, girth: float = 1.0) -> Skin:
    """Return the skin of a whole body with a given shape; girth: factor across each segment [1]."""
    placed = _placed(body, shape, template)
    vertices = np.zeros_like(shape.vertices)
    for link, weights in zip(LINKS, template.weights.T, strict=True):
        at, moved = placed[link], np.nonzero(weights)[0]
        across = girth ** LEAN.get(link, 1.0)
        p_link = (shape.vertices[moved] - at.p_template) @ at.R * at.scale * (across, across, 1.0)
        vertices[moved] += weights[moved, None] * (p_link @ at.R.T + at.p_base)
    T_base_link = np.array([homogeneous(placed[link].R, placed[link].p_base) for link in LINKS])
    return Skin(LINKS, vertices, template.triangles, template.weights, T_base_link, template.zones, template.regions)


def _placed(body: Body, shape: SkinShape, template: SkinTemplate) -> dict[str, Placed]:
    """Return the pose of each link in the template and in the body."""
    segments = {segment.link: segment for segment in body.segments.values()}
    placed = _trunk(segments, shape, body.subject.height)
    for side in SIDES:
        placed |= _arm(segments, shape, placed["torso"], side[0])
        placed |= _leg(segments, shape, template, placed["waist"], side[0])
    return placed


def _trunk(segments: dict[str, BodySegment], shape: SkinShape, height: float) -> dict[str, Placed]:
    """Return the placed waist, torso and head; they have the template's axes, and its spine is straightened."""
    joints = shape.joints
    hips = 0.5 * (joints["l-upper-leg"] + joints["r-upper-leg"])
    shoulders = 0.5 * (joints["l-shoulder"] + joints["r-shoulder"])
    top = float(np.max(shape.vertices[:, 2]))
    waist = float(segments["torso"].p_parent_link[2])  # height of the torso above the waist's origin
    trunk = waist + float(segments["head"].p_parent_link[2])
    along = trunk / (joints["neck"][2] - hips[2])
    all_over = height / top
    wide = 0.5 * (all_over + segments["l_shoulder"].p_parent_link[1] / joints["l-shoulder"][1])
    skull = segments["head"].length / (top - joints["neck"][2])
    origins = {
        "waist": (np.array([hips[0], 0.0, hips[2]]), (all_over, wide, along), 0.0),
        "torso": (np.array([shoulders[0], 0.0, hips[2] + waist / along]), (all_over, wide, along), waist),
        "head": (np.array([shoulders[0], 0.0, joints["neck"][2]]), (all_over, all_over, skull), trunk),
    }
    return {
        link: Placed(np.eye(3), p_template, np.array(scale), np.array([0.0, 0.0, up]))
        for link, (p_template, scale, up) in origins.items()
    }


def _arm(segments: dict[str, BodySegment], shape: SkinShape, torso: Placed, side: str) -> dict[str, Placed]:
    """Return the placed links of an arm; y of the upper arm is the elbow axis, x of the others points to the thumb."""
    names = ("shoulder", "elbow", "hand", "finger-2-1", "finger-3-1", "finger-3-4", "finger-5-1")
    shoulder, elbow, wrist, index, middle, tip, little = (shape.joints[f"{side}-{name}"] for name in names)
    upper, lower = shoulder - elbow, elbow - wrist  # along z, upwards
    forward = np.cross(np.cross(lower, upper), upper)
    R_upper, R_flexed = _axes(upper, forward), _axes(lower, np.cross(np.cross(lower, upper), lower))
    R_lower, R_hand = _axes(lower, index - little), _axes(wrist - middle, index - little)
    size = torso.scale[0]
    placed, p_base = dict[str, Placed](), torso.p_base + segments[f"{side}_shoulder"].p_parent_link
    for name, between, axes, start, end in (
        ("shoulder", "shoulder_abd", (R_upper, R_upper), shoulder, elbow),
        ("elbow", "elbow_flex", (R_lower, R_flexed), elbow, wrist),
        ("wrist", "", (R_hand, R_hand), wrist, tip),
    ):
        segment = segments[f"{side}_{name}"]
        scale = np.array([size, size, segment.length / np.linalg.norm(end - start)])
        placed[f"{side}_{name}"] = Placed(axes[0], start, scale, p_base)
        if between:
            placed[f"{side}_{between}"] = Placed(axes[1], start, scale, p_base)
        p_base = p_base - segment.length * axes[0][:, 2]
    return placed


def _leg(
    segments: dict[str, BodySegment], shape: SkinShape, template: SkinTemplate, waist: Placed, side: str
) -> dict[str, Placed]:
    """Return the placed links of a leg; their x axes point forward, that of the foot to the toes."""
    hip, knee, ankle, toe = (shape.joints[f"{side}-{name}"] for name in ("upper-leg", "knee", "ankle", "toe-2-4"))
    size, forward, up = waist.scale[0], np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    placed, p_base = dict[str, Placed](), segments[f"{side}_hip"].p_parent_link
    for name, start, end in (("hip", hip, knee), ("knee", knee, ankle)):
        R, segment = _axes(start - end, forward), segments[f"{side}_{name}"]
        scale = np.array([size, size, segment.length / np.linalg.norm(end - start)])
        placed[f"{side}_{name}"] = Placed(R, start, scale, p_base)
        p_base = p_base - segment.length * R[:, 2]
    placed[f"{side}_hip_abd"] = placed[f"{side}_hip"]
    R, foot = _axes(up, toe - ankle), segments[f"{side}_ankle"]
    moved = template.weights[:, LINKS.index(f"{side}_ankle")] > 0.5
    length = float(np.ptp((shape.vertices[moved] - ankle) @ R[:, 0]))
    sole = foot.start[2] - foot.radius
    placed[f"{side}_ankle"] = Placed(R, ankle, np.array([foot.length / length, size, -sole / ankle[2]]), p_base)
    return placed


def _axes(z: FloatArray, x: FloatArray) -> FloatArray:
    """Return the axes with z in a given direction and x as near to another one as can be, shape (3, 3)."""
    up = z / np.linalg.norm(z)
    forward = x - (x @ up) * up
    forward = forward / np.linalg.norm(forward)
    return np.column_stack((forward, np.cross(up, forward), up))
