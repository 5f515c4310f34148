"""Chart of the safety supervisor's states and of violations of the protective distance over time."""

from hric_bags.records.safety_record import SLOWED, STOPPED, SafetyRecord
from hric_report.html.strip import Strip, StripBar, time_axis

LOOKS = {SLOWED: "level2", STOPPED: "level3"}
"""CSS class of each drawn state; the state "free" is not drawn."""


def strip(record: SafetyRecord | None) -> Strip | None:
    """Return the chart of supervisor states and violations; None without a supervisor."""
    if record is None:
        return None
    bars = [_bar(begin, end, 0, LOOKS[state], state) for state in LOOKS for begin, end in record.stretches(state)]
    bars += [_bar(begin, end, 1, "above", "nearer than the protective distance") for begin, end in record.violations]
    violated = bool(record.violations)
    red = ", and nearer than the protective distance (red)" if violated else ""
    title = f"Slowed (yellow) and stopped (orange){red}; a click shows the time in the replay"
    labels = ["state", *["violation"] * violated]
    return Strip("supervisor", title, labels, time_axis(record.time[0], record.time[-1]), bars)


def _bar(begin: float, end: float, row: int, look: str, what: str) -> StripBar:
    return StripBar(begin, end, row, look, f"{what} from {begin:.2f} to {end:.2f} s")
