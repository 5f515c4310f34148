"""Worst moment of a recording: capsules of arm and person at that instant, as data and as a picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated
from xml.sax.saxutils import escape

import numpy as np

from hric_assessment.findings import BoolArray, Finding
from hric_assessment.separation.capsules import CapsuleMotion, Capsules, distances, of_body
from hric_assessment.typed_json import Content
from hric_assessment.verdict.conclusions import BY_DEFAULT, CONTACT, ORDER, OUTCOMES, POSTURE, Conclusion, Reply
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_core import urdf
from hric_core.geometry import FloatArray

INSTANTS = 200
"""Number of instants in a finding's window among which that of the smallest distance is searched (project default)."""
WIDTH, HIGHEST, HEAD, MARGIN = 420.0, 320.0, 20.0, 14.0
"""Width and maximum height of the picture, height of its legend, and its margin [units of the picture]."""
TILT = np.radians(15.0)
"""Elevation of the viewer above the horizontal [rad] (project default)."""
ROBOT, PERSON, MARKS = "#8fa3b8", "#d9b48f", {"no": "#b3261e", "unknown": "#7a3fb0", "warning": "#d98324"}
"""Colours of arm, of person, and of the deciding capsules by the conclusion's reply (green for yes)."""


@dataclass(frozen=True)
class PlacedCapsule:
    """Capsule of a link in the world; decides: True if the capsule belongs to the pair or arm that decides."""

    link: str
    ends: Annotated[
        Sequence[Annotated[Sequence[float], ("minItems", 3), ("maxItems", 3)]],
        "of the straight part, in the world [m]",
        ("minItems", 2),
        ("maxItems", 2),
    ]
    radius: Annotated[float, "[m]"]
    decides: Annotated[bool, "of the pair, or the arm, that decides"]


@dataclass(frozen=True)
class Moment:
    """Capsules of arm and person at an instant, with the conclusion that it illustrates; time: robot time [s]."""

    time: float
    question: Annotated[str, ("enum", BY_DEFAULT)]
    reply: Annotated[Reply, ("enum", ("yes", "warning", "no", "unknown"))]
    subject: str
    arm: Sequence[PlacedCapsule]
    person: Sequence[PlacedCapsule]

    @classmethod
    def of(cls, content: Content) -> "Moment":
        """Return the moment from its content in a verdict.json."""
        capsules = {model: [PlacedCapsule(**item) for item in content[model]] for model in ("arm", "person")}
        return cls(**{**content, **capsules})


def moment(
    source: AssessmentInput,
    people: Sequence[AssessedPerson],
    conclusions: Sequence[Conclusion],
    findings: Sequence[Finding],
) -> Moment | None:
    """Return arm and person at the worst moment; None: no position is known.

    It is the moment of a finding above its limit, else of the worst contact or distance, else of the posture.

    Args:
        source: recording with the files next to it.
        people: persons of the recording.
        conclusions: conclusions about all questions.
        findings: findings to which the conclusions refer.
    """
    decisive = _decisive(conclusions, findings)
    if decisive is None or not people:
        return None
    conclusion, regions, window = decisive
    person = next((person for person in people if person.name == conclusion.person), people[0])
    begin, end = np.clip(window, person.time[0], person.time[-1]).tolist()
    time = np.linspace(begin, end, INSTANTS)
    body, arm = of_body(person.body), Capsules((), np.empty((0, 2, 3)), np.empty(0))
    root = None if person.root is None else person.root.transforms
    q = np.nan_to_num(person.q)
    ends = CapsuleMotion(urdf.read(person.body.urdf), body, person.names, person.time, q, root)(time)
    log, at = source.recording.log, 0
    marked: tuple[list[int], list[int]] = [], _of_arm(person, conclusion)
    arm_ends = np.empty((len(time), 0, 2, 3))
    if log is not None and source.description and root is not None:
        motion, _ = source.arm(log)
        arm, arm_ends = motion.capsules, motion(time) if motion.capsules.links else arm_ends
    if not (np.isfinite(ends).all() and np.isfinite(arm_ends).all()):
        return None
    if arm.links and conclusion.question != POSTURE:
        gaps = distances(arm_ends, arm.radii, ends, body.radii)
        gaps[:, :, ~_concerned(person, body, regions)] = np.inf
        at, first, second = (int(k) for k in np.unravel_index(int(np.argmin(gaps)), gaps.shape))
        marked = [first], [second]
    capsules = _listed(arm, arm_ends[at], marked[0]), _listed(body, ends[at], marked[1])
    return Moment(float(time[at]), conclusion.question, conclusion.reply, conclusion.subject, *capsules)


def _decisive(
    conclusions: Sequence[Conclusion], findings: Sequence[Finding]
) -> tuple[Conclusion, Sequence[str], tuple[float, float]] | None:
    """Return the worst of the conclusions that have a place and a time; None: there is no such conclusion.

    With it, return the regions of its contact (empty for other questions), and its time window [s].
    """
    pairs = [(item, findings[item.finding]) for item in conclusions if item.finding is not None]
    placed = [
        (conclusion, finding.regions if conclusion.question == CONTACT else (), window)
        for conclusion, finding in pairs
        if conclusion.question in BY_DEFAULT and (window := finding.window)
        if conclusion.question != CONTACT or finding.regions
    ]
    return min(placed, key=lambda item: _rank(item[0]), default=None)


def _rank(conclusion: Conclusion) -> tuple[bool, bool, int]:
    """Return a sort key by which the worst conclusion comes first."""
    severity = ORDER.index(OUTCOMES[conclusion.reply])
    return conclusion.reply != Reply.NO, conclusion.question == POSTURE, severity


def _of_arm(person: AssessedPerson, conclusion: Conclusion) -> list[int]:
    """Return the indices of the capsules of the person's arm that a posture conclusion is about; else none."""
    side = next((side for side in person.sides if side in conclusion.subject), None)
    arm = (f"{side}_upper_arm", f"{side}_forearm", f"{side}_hand")
    return [k for k, name in enumerate(person.body.segments) if name in arm and conclusion.question == POSTURE]


def _concerned(person: AssessedPerson, body: Capsules, regions: Sequence[str]) -> BoolArray:
    """Return True for capsules that belong to some regions, shape (m,); for all if none does."""
    of_link = person.body.regions
    concerned = np.array([any(region.name in regions for region in of_link.get(link, ())) for link in body.links])
    return concerned if concerned.any() else np.ones(len(body.links), dtype=bool)


def _listed(capsules: Capsules, ends: FloatArray, marked: Sequence[int]) -> list[PlacedCapsule]:
    """Return capsules in the world.

    Args:
        capsules: capsules of a model.
        ends: axis ends in the world, shape (k, 2, 3) [m].
        marked: indices of deciding capsules.
    """
    rows = zip(capsules.links, np.round(ends, 4).tolist(), np.round(capsules.radii, 4).tolist(), strict=True)
    return [PlacedCapsule(*row, k in marked) for k, row in enumerate(rows)]


def picture(scene: Moment) -> str:
    """Return an SVG picture of arm and person, seen perpendicular to the line between them."""
    arm, person = scene.arm, scene.person
    capsules = [*arm, *person]
    flat = np.array([capsule.ends for capsule in capsules]) @ _view(arm, person).T
    radii = np.array([capsule.radius for capsule in capsules])
    low, high = ((flat[..., :2] + side * radii[:, None, None]) for side in (-1.0, 1.0))
    left, bottom = low.min(axis=(0, 1))
    right, top = high.max(axis=(0, 1))
    scale = min((WIDTH - 2.0 * MARGIN) / (right - left), (HIGHEST - 2.0 * MARGIN) / (top - bottom))
    height = HEAD + scale * (top - bottom) + 2.0 * MARGIN
    flat[..., 0] = 0.5 * WIDTH + scale * (flat[..., 0] - 0.5 * (left + right))
    flat[..., 1] = height - MARGIN - scale * (flat[..., 1] - bottom)
    mark = MARKS.get(scene.reply, "#2c8f52")
    drawn = []
    for k in np.argsort(flat[..., 2].mean(axis=1)):
        fill = mark if capsules[k].decides else ROBOT if k < len(arm) else PERSON
        drawn.append(_capsule(flat[k], 2.0 * scale * radii[k], fill, capsules[k].link))
    key = [("robot", ROBOT), ("person", PERSON), (f"decides: {scene.reply}", mark)][0 if arm else 1 :]
    words = "".join(
        f'<circle cx="{MARGIN + 90 * k:g}" cy="12" r="6" fill="{fill}"/>'
        f'<text x="{MARGIN + 10 + 90 * k:g}" y="16" font-size="12" fill="currentColor">{escape(word)}</text>'
        for k, (word, fill) in enumerate(key)
    )
    bar = 0.5 if scale < 0.5 * WIDTH else 0.1
    label = f"arm and person at {scene.time:.3f} s: {scene.subject}"
    return (
        f'<svg class="moment" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:.0f}" role="img">'
        f"<title>{escape(label)}</title>{''.join(drawn)}{words}"
        f'<path d="M{WIDTH - MARGIN - bar * scale:.1f} 22h{bar * scale:.1f}" stroke="currentColor" stroke-width="2"/>'
        f'<text x="{WIDTH - MARGIN:g}" y="16" font-size="12" text-anchor="end" fill="currentColor">{bar:g} m</text>'
        "</svg>"
    )


def _view(arm: Sequence[PlacedCapsule], person: Sequence[PlacedCapsule]) -> FloatArray:
    """Return the axes of the view in the world as rows: right (from arm to person), up, towards the viewer, (3, 3)."""
    middles = [np.mean([capsule.ends for capsule in model], axis=(0, 1))[:2] for model in (arm, person) if model]
    between = middles[-1] - middles[0] if len(middles) == 2 else np.array([1.0, 0.0])
    x, y = between / max(float(np.linalg.norm(between)), 1e-9)
    right, viewer = np.array([x, y, 0.0]), np.array([np.cos(TILT) * y, -np.cos(TILT) * x, np.sin(TILT)])
    return np.array([right, np.cross(viewer, right), viewer])


def _capsule(ends: FloatArray, width: float, fill: str, link: str) -> str:
    """Return the SVG of a capsule with an outline; ends, shape (2, 3), and width in units of the picture."""
    (x1, y1), (x2, y2) = ends[:, :2]
    line = f'd="M{x1:.1f} {y1:.1f}L{x2 + 0.01:.2f} {y2:.1f}" stroke-linecap="round" fill="none"'
    return (
        f'<g><title>{escape(link)}</title><path {line} stroke="#ffffff" stroke-width="{width + 2.0:.1f}"/>'
        f'<path {line} stroke="{fill}" stroke-width="{width:.1f}"/></g>'
    )
