"""Figure of the safety supervisor: protective distance and speed scale."""

from hric_report.figure import Curve, Figure, Panel
from hric_report.figures import FigureData
from hric_report.sections import SUPERVISOR

CAPTION = (
    "Distance between the arm and the body part with the smallest margin, and the protective distance required at the "
    "measured speeds; speed scale requested by the supervisor. Bands: the arm moves nearer than the protective "
    "distance. "
    "Estimate of a model, not a certified safety function."
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
    title = "Distance between arm and person, and requested speed scale"
    return [Figure("supervisor", title, "", panels, 0.1, bands=bands).about(SUPERVISOR, CAPTION)]
