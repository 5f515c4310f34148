"""Front and back view of the human body as SVG, with body regions coloured by contact load over limit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from markupsafe import Markup

from hric_core.geometry import FloatArray
from hric_core.urdf import read
from hric_human.body import Subject, describe
from hric_human.body.segments import SIDES
from hric_report.html import templates
from hric_report.html.verdict_file import FindingEntry
from hric_skin import PAIRED, SCALE, fitted, region_key, shade
from hric_skin.outlines import outlines

CONTACT, NOT_ASSESSABLE = "contact", "not assessable"
PERSON = Subject(code="P50", mass=77.0, height=1.76, sex="male", parts="whole_body")
"""Subject whose body the picture shows, also if the assessed person has another size."""
POSTURE = {f"{side}_sh_abd": 0.5 for side in SIDES}
"""Joint angles of the body in the picture that are not 0 [rad]; in this posture no limb hides another."""
PER_METRE, WIDTH, HEIGHT = 200.0, 216.0, 372.0
"""Size of a view: units of the picture per metre, and width and height of one view in these units."""
ARMS = ("upper arm, elbow", "lower arm, wrist", "hand, fingers")
"""Regions of an arm; they are drawn faintly on a side whose arm the body model lacks."""


@dataclass(frozen=True)
class Touched:
    """Summary of all contact findings on one body region.

    Attributes:
        share: largest share of the limit [1]; None: unknown for every contact.
        assessable: True if all contacts could be compared with limits.
        outcome: worst outcome of the findings.
        time: start of the worst contact [s]; None: unknown.
        sided: True if the side of the body is known for all contacts; False: some may have been on the other side.
    """

    share: float | None
    assessable: bool
    outcome: str
    time: float | None
    sided: bool = True

    @property
    def fill(self) -> str:
        """Fill colour of the region."""
        return colour(shown_share(self.share, self.outcome))

    @property
    def text(self) -> str:
        """Text with outcome, largest share of the limit, and a remark if the side is not known."""
        share = "share of the limit not known" if self.share is None else f"{100.0 * self.share:.0f} % of the limit"
        return f"{self.outcome}, {share}" + ("" if self.sided else "; it is not known on which side")


def touched(findings: Sequence[FindingEntry]) -> dict[str, Touched]:
    """Summarise the contact findings of a verdict by region (see `hric_skin.REGION_KEYS`).

    A contact whose side is not known counts on both sides.

    Args:
        findings: all findings, the worst first.
    """
    regions: dict[str, Touched] = {}
    for finding in findings:
        if finding["group"] != CONTACT:
            continue
        assessable, share, side = finding["outcome"] != NOT_ASSESSABLE, finding["share"], finding["side"]
        begin = finding["window"][0] if finding["window"] else None
        for region, key in ((name, key) for name in finding["regions"] for key in region_keys(name, side)):
            sided = bool(side) or region not in PAIRED
            known = regions.get(key)
            if known is None:
                regions[key] = Touched(share, assessable, finding["outcome"], begin, sided)
                continue
            shares = [value for value in (known.share, share) if value is not None]
            regions[key] = Touched(
                max(shares, default=None),
                known.assessable and assessable,
                known.outcome,
                known.time,
                known.sided and sided,
            )
    return regions


def region_keys(region: str, side: str) -> tuple[str, ...]:
    """Return the keys of a region of the skin (see `hric_skin.REGION_KEYS`).

    Args:
        region: region of ISO/TS 15066.
        side: "right" or "left"; "": not known, which gives the keys of both sides if the body has two such regions.
    """
    return tuple(region_key(region, one) for one in SIDES if side in ("", one)) if region in PAIRED else (region,)


def colour(share: float | None) -> str:
    """Return the colour of a share of the limit [1] as hex code; None: not known."""
    return "#" + "".join(f"{round(255.0 * x):02x}" for x in shade(share))


def shown_share(share: float | None, outcome: str) -> float | None:
    """Return the share of the limit by which a contact is coloured [1]; None: not known.

    A contact whose outcome is "above limits" by an unknown amount gets 1.
    """
    return 1.0 if share is None and outcome == "above limits" else share


@cache
def views() -> tuple[dict[str, str], dict[str, str]]:
    """Return the SVG path of each region by its key, in the front view and in the back view, farthest regions first."""
    body = describe(PERSON)
    skin = fitted(body)
    vertices = skin.posed(read(body.urdf).poses(POSTURE))
    low = vertices[:, 2].min()
    seen = (outlines(skin, vertices, back=back) for back in (False, True))
    front, back = ({key: "".join(_paths(loops, low)) for key, loops in view.items() if loops} for view in seen)
    return front, back


def _paths(loops: Sequence[FloatArray], low: float) -> Iterator[str]:
    """Yield the SVG path of each polygon.

    Args:
        loops: polygons, shape (k, 2) each [m].
        low: height that the lower edge of the view shows [m].
    """
    for loop in loops:
        xy = np.round((loop - (0.0, low)) * (PER_METRE, -PER_METRE) + (0.5 * WIDTH, HEIGHT - 8.0), 1)
        yield "M" + " ".join(f"{x:g} {y:g}" for x, y in xy) + "Z"


def picture(findings: Sequence[FindingEntry], arms: Sequence[str] = ()) -> Markup:
    """Return the SVG picture of the body from the front and from behind, with its legend.

    A region without contact is empty, one with a contact that could not be assessed is hatched, and one above its limit
    has a thick outline.

    Args:
        findings: findings of a verdict, the worst first.
        arms: sides of the arms of the body model; empty: both. A missing arm is drawn faintly, without colour.
    """
    lacking = [region_key(region, side) for side in SIDES for region in ARMS if arms and side not in arms]
    both = dict(zip(("front", "back"), views(), strict=True))
    values = {"touched": touched(findings), "lacking": lacking, "scale": SCALE, "width": WIDTH, "height": HEIGHT}
    return Markup(templates.environment(colour=colour).get_template("body.html").render(views=both, **values))
