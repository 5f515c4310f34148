"""Front view of a body as SVG, with the regions of ISO/TS 15066 coloured by their share of the limit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from hric_report.html.tables import escape

CONTACT, NOT_ASSESSABLE = "contact", "not assessable"
SCALE = ((0.0, (246, 234, 196)), (0.8, (224, 138, 44)), (1.0, (179, 38, 30)))
"""Share of the limit and colour of each stop, interpolated linearly; shares above 1 have the last colour."""
SHAPES: Mapping[str, str] = {
    "skull, forehead": "M84 34 a16 18 0 0 1 32 0 z",
    "face": "M84 34 h32 q0 24 -16 26 q-16 -2 -16 -26 z",
    "neck": "M93 61 h14 v9 h-14 z",
    "chest": "M93 86 h14 l21 10 v26 q-28 10 -56 0 v-26 z",
    "abdomen": "M72 124 q28 10 56 0 l-3 36 q-25 8 -50 0 z",
    "pelvis": "M75 162 q25 8 50 0 l5 26 q-15 14 -30 14 q-15 0 -30 -14 z",
}
"""SVG paths of the central regions of the body in a picture 200 wide and 380 high; the person faces the reader."""
PAIRS: Mapping[str, str] = {
    "back, shoulders": "M92 71 q-26 3 -33 15 l13 10 l20 -10 z",
    "upper arm, elbow": "M57 89 l11 10 l-1 48 q-8 6 -17 0 q-1 -45 7 -58 z",
    "lower arm, wrist": "M50 150 q8 5 17 0 l-6 55 h-14 z",
    "hand, fingers": "M47 208 h14 v16 q-2 14 -8 14 q-8 -2 -9 -16 z",
    "thigh, knee": "M69 192 q12 12 29 13 l-3 78 h-22 z",
    "lower leg": "M73 286 h22 l-3 72 h-15 z",
    "foot, toes, ankle": "M77 361 h15 l2 12 h-28 q0 -8 11 -12 z",
}
"""SVG paths of regions on two sides, for the person's right side, which is on the left of the picture."""
OF_ARMS = ("upper arm, elbow", "lower arm, wrist", "hand, fingers")
"""Regions that are missing if the body model lacks the arm of that side."""
SIDES = ("right", "left")
MIRRORED = 'transform="translate(200 0) scale(-1 1)"'


def _drawn(region: str, sides: Sequence[str]) -> str:
    """Return the SVG paths of a region on the listed sides of the body."""
    if region in SHAPES:
        return f'<path d="{SHAPES[region]}"/>'
    both = {"right": f'<path d="{PAIRS[region]}"/>', "left": f'<path d="{PAIRS[region]}" {MIRRORED}/>'}
    return "".join(path for side, path in both.items() if side in sides)


@dataclass(frozen=True)
class Touched:
    """Assessment of all contacts with one body region.

    Attributes:
        share: largest share of the limit [1]; None: unknown for every contact.
        assessable: True if all contacts could be compared with limits.
        outcome: worst outcome.
        time: start of the worst contact [s]; None: unknown.
    """

    share: float | None
    assessable: bool
    outcome: str
    time: float | None


def touched(findings: Sequence[Mapping[str, Any]]) -> dict[str, Touched]:
    """Summarise the contact findings by region; findings: those of a verdict, the worst first."""
    found: dict[str, Touched] = {}
    for one in findings:
        if one["group"] != CONTACT:
            continue
        assessable, share = one["outcome"] != NOT_ASSESSABLE, one["share"]
        begin = one["window"][0] if one["window"] else None
        for region in one["regions"]:
            if region not in found:
                found[region] = Touched(share, assessable, one["outcome"], begin)
                continue
            known = found[region]
            shares = [value for value in (known.share, share) if value is not None]
            both = known.assessable and assessable
            found[region] = Touched(max(shares, default=None), both, known.outcome, known.time)
    return found


def colour(share: float) -> str:
    """Return the colour of a share of the limit, as a hex code."""
    for (low, a), (high, b) in pairwise(SCALE):
        if share <= high:
            part = max(share - low, 0.0) / (high - low)
            return "#" + "".join(f"{round(x + part * (y - x)):02x}" for x, y in zip(a, b, strict=True))
    return "#" + "".join(f"{x:02x}" for x in SCALE[-1][1])


def picture(findings: Sequence[Mapping[str, Any]], arms: Sequence[str] = ()) -> str:
    """Return the SVG of the body with its legend.

    A region without contact is empty, one with a contact that could not be assessed is hatched, and one above its limit
    has a thick outline.

    Args:
        findings: findings of a verdict, the worst first.
        arms: sides of the arms of the body model; empty: both. A missing arm is drawn faintly, without colour.
    """
    met = touched(findings)
    parts = []
    for region in (*SHAPES, *PAIRS):
        one = met.get(region)
        said, look = f"{region}: not touched", 'fill="none"'
        jump = ""
        if one is not None:
            share = "share of the limit not known" if one.share is None else f"{100.0 * one.share:.0f} % of the limit"
            said = f"{region}: {one.outcome}, {share}"
            above = one.outcome == "above limits"
            fill = colour(1.0 if one.share is None and above else one.share or 0.0)
            look = f'fill="{fill}"' + (' class="above"' if above else "")
            jump = "" if one.time is None else f' class="jump" tabindex="0" role="button" data-time="{one.time:.9g}"'
        own = arms if arms and region in OF_ARMS else SIDES
        drawn = _drawn(region, own)
        lacks = "" if region in SHAPES else _drawn(region, [side for side in SIDES if side not in own])
        hatched = f'<g class="hatched">{drawn}</g>' if one is not None and not one.assessable else ""
        parts.append(
            f'<g data-region="{escape(region)}"{jump}><title>{escape(said)}</title><g {look}>{drawn}</g>{hatched}</g>'
            + (f'<g class="lacks" fill="none">{lacks}</g>' if lacks else "")
        )
    stops = "".join(f'<stop offset="{share:g}" stop-color="{colour(share)}"/>' for share, _ in SCALE)
    defined = (
        '<defs><pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
        f'<line x1="0" y1="0" x2="0" y2="6"/></pattern><linearGradient id="share">{stops}</linearGradient></defs>'
    )
    legend = (
        '<g class="scale"><rect x="40" y="386" width="120" height="9" fill="url(#share)"/><text x="40" y="407">0</text>'
        '<text x="160" y="407" text-anchor="end">100 %</text><text x="40" y="419">share of the limit</text>'
        '<rect x="40" y="425" width="9" height="9" class="hatched"/><text x="54" y="433">not assessable</text></g>'
    )
    label = 'role="img" aria-label="body, its regions coloured by the share of their limits"'
    return f'<svg class="body" viewBox="20 0 160 440" {label}>{defined}{"".join(parts)}{legend}</svg>'
