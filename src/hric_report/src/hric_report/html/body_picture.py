"""Front view of the human body as SVG, with the regions of ISO/TS 15066 coloured by contact load over limit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from markupsafe import Markup

from hric_report.html import templates
from hric_report.html.verdict_file import FindingEntry

CONTACT, NOT_ASSESSABLE = "contact", "not assessable"
SCALE = ((0.0, (246, 234, 196)), (0.8, (224, 138, 44)), (1.0, (179, 38, 30)))
"""Colour scale: (share of the limit, RGB colour), interpolated linearly; shares above 1 have the last colour."""
SHAPES: Mapping[str, str] = {
    "skull, forehead": "M84 34 a16 18 0 0 1 32 0 z",
    "face": "M84 34 h32 q0 24 -16 26 q-16 -2 -16 -26 z",
    "neck": "M93 61 h14 v9 h-14 z",
    "chest": "M93 86 h14 l21 10 v26 q-28 10 -56 0 v-26 z",
    "abdomen": "M72 124 q28 10 56 0 l-3 36 q-25 8 -50 0 z",
    "pelvis": "M75 162 q25 8 50 0 l5 26 q-15 14 -30 14 q-15 0 -30 -14 z",
}
"""SVG paths of the central body regions, in a picture 200 wide and 380 high; the person faces the reader."""
PAIRS: Mapping[str, str] = {
    "back, shoulders": "M92 71 q-26 3 -33 15 l13 10 l20 -10 z",
    "upper arm, elbow": "M57 89 l11 10 l-1 48 q-8 6 -17 0 q-1 -45 7 -58 z",
    "lower arm, wrist": "M50 150 q8 5 17 0 l-6 55 h-14 z",
    "hand, fingers": "M47 208 h14 v16 q-2 14 -8 14 q-8 -2 -9 -16 z",
    "thigh, knee": "M69 192 q12 12 29 13 l-3 78 h-22 z",
    "lower leg": "M73 286 h22 l-3 72 h-15 z",
    "foot, toes, ankle": "M77 361 h15 l2 12 h-28 q0 -8 11 -12 z",
}
"""SVG paths of the paired body regions: those of the person's right side, on the left of the picture."""
OF_ARMS = ("upper arm, elbow", "lower arm, wrist", "hand, fingers")
"""Regions of an arm; they are drawn faintly on a side whose arm the body model lacks."""
SIDES = ("right", "left")


@dataclass(frozen=True)
class Touched:
    """Summary of all contact findings on one body region.

    Attributes:
        share: largest share of the limit [1]; None: unknown for every contact.
        assessable: True if all contacts could be compared with limits.
        outcome: worst outcome of the findings.
        time: start of the worst contact [s]; None: unknown.
    """

    share: float | None
    assessable: bool
    outcome: str
    time: float | None

    @property
    def fill(self) -> str:
        """Fill colour of the region; for a value above its limit by an unknown share, the colour of 100 %."""
        return colour(1.0 if self.share is None and self.outcome == "above limits" else self.share or 0.0)


def touched(findings: Sequence[FindingEntry]) -> dict[str, Touched]:
    """Summarise the contact findings of a verdict by body region; `findings`: all findings, the worst first."""
    regions: dict[str, Touched] = {}
    for finding in findings:
        if finding["group"] != CONTACT:
            continue
        assessable, share = finding["outcome"] != NOT_ASSESSABLE, finding["share"]
        begin = finding["window"][0] if finding["window"] else None
        for region in finding["regions"]:
            if region not in regions:
                regions[region] = Touched(share, assessable, finding["outcome"], begin)
                continue
            known = regions[region]
            shares = [value for value in (known.share, share) if value is not None]
            both = known.assessable and assessable
            regions[region] = Touched(max(shares, default=None), both, known.outcome, known.time)
    return regions


def colour(share: float) -> str:
    """Return the colour of a share of the limit [1] in SCALE, as hex code."""
    for (low, a), (high, b) in pairwise(SCALE):
        if share <= high:
            part = max(share - low, 0.0) / (high - low)
            return "#" + "".join(f"{round(x + part * (y - x)):02x}" for x, y in zip(a, b, strict=True))
    return "#" + "".join(f"{x:02x}" for x in SCALE[-1][1])


def picture(findings: Sequence[FindingEntry], arms: Sequence[str] = ()) -> Markup:
    """Return the SVG picture of the body with its legend.

    A region without contact is empty, one with a contact that could not be assessed is hatched, and one above its limit
    has a thick outline.

    Args:
        findings: findings of a verdict, the worst first.
        arms: sides of the arms of the body model; empty: both. A missing arm is drawn faintly, without colour.
    """
    environment = templates.environment(colour=colour)
    values = {"shapes": SHAPES, "pairs": PAIRS, "of_arms": OF_ARMS, "sides": SIDES, "scale": SCALE, "arms": arms}
    return Markup(environment.get_template("body.html").render(touched=touched(findings), **values))
