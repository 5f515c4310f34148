"""Protective distance and speed scale of a supervised run."""

from hric_report.figure import Curve, Figure, Panel
from hric_report.figures import FigureData
from hric_report.sections import SUPERVISOR

CAPTION = (
    "Distance of the part of the person with the smallest margin from the arm, beside the protective distance that it "
    "should have at the measured speeds; the speed scale that was requested. Bands: the arm moves nearer than that. "
    "A model's estimate, no certified safety function."
)


def figures(data: FigureData) -> list[Figure]:
    """Return the figure of actual and protective distance and of the speed scale; empty without a supervisor."""
    record = data.safety
    if record is None:
        return []
    distance = (
        Curve("protective distance", "setpoint", record.time, record.protective),
        Curve("distance", "measured", record.time, record.protective + record.margin),
    )
    scale = (Curve("requested scale", "s2", record.time, record.scale),)
    panels = (Panel("distance", distance, unit="distance [m]"), Panel("speed", scale, unit="scale [1]"))
    bands = tuple(("violation", begin, end) for begin, end in record.violations)
    title = "Distance of arm and person, and the speed that was requested"
    return [Figure("supervisor", title, "", panels, 0.1, bands=bands).about(SUPERVISOR, CAPTION)]
