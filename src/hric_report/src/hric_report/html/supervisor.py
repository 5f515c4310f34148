"""States and violations of a supervisor over time, as strips of bars; a click on a bar shows it in the replay."""

from collections.abc import Sequence

from hric_bags.records.safety_record import SLOWED, STOPPED, SafetyRecord
from hric_report.html.verdict import Axis

LOOKS = {SLOWED: "level2", STOPPED: "level3"}
"""CSS class of the colour of a state; the state free is not drawn."""
VIOLATION = "above"


def part(record: SafetyRecord | None) -> str:
    """Return the HTML of the strips; empty without a supervisor. The disclaimer is part of the verdict."""
    if record is None:
        return ""
    axis = Axis(float(record.time[0]), float(record.time[-1]))
    states = [(begin, end, state) for state in LOOKS for begin, end in record.stretches(state)]
    bars = [axis.bar(begin, end, 0, LOOKS[state], _said(state, begin, end)) for begin, end, state in states]
    labels: Sequence[str] = ("state",)
    if violations := record.violations:
        labels = (*labels, "violation")
        bars += [axis.bar(begin, end, 1, VIOLATION, _said("nearer than S_p", begin, end)) for begin, end in violations]
    red = ", and nearer than the protective distance (red)" if violations else ""
    caption = (
        f"<figcaption>Slowed (yellow) and stopped (orange){red}; a click shows the time in the replay</figcaption>"
    )
    strip = axis.picture("supervisor", labels, "".join(bars))
    return f"<figure class=along>{caption}{strip}</figure>"


def _said(what: str, begin: float, end: float) -> str:
    return f"{what} from {begin:.2f} to {end:.2f} s"
