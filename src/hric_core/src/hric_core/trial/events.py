"""Reader of the events in a c3d file, such as foot strikes (parameter group EVENT)."""

from typing import NamedTuple

from hric_core.trial.plates import Group, numbers

GENERAL = "General"
"""Context of an event that belongs to no side of the body."""
BLANKS = " \t\r\n\0"
"""Characters with which exporters fill up texts."""


class TrialEvent(NamedTuple):
    """Event in a trial.

    Attributes:
        time: time since the first frame [s].
        label: name of the event, e.g. "Foot Strike".
        context: side of the body or other context, e.g. "Left".
    """

    time: float
    label: str
    context: str = GENERAL


def read_events(group: Group, start: float) -> tuple[TrialEvent, ...]:
    """Return the events of a c3d file in the order of time.

    Args:
        group: parameter group EVENT; its TIMES are minutes and seconds since frame number 1, in two rows.
        start: time from frame number 1 to the first frame in the file [s].
    """
    times = numbers(group, "TIMES")
    if times.ndim != 2 or len(times) != 2:
        return ()
    labels, contexts = ([str(text).strip(BLANKS) for text in group.get(name, [])] for name in ("LABELS", "CONTEXTS"))
    count = times.shape[1]
    labels, contexts = ((texts + [""] * count)[:count] for texts in (labels, contexts))
    events = zip((60.0 * times[0] + times[1] - start).tolist(), labels, contexts, strict=True)
    return tuple(sorted(TrialEvent(time, label, context or GENERAL) for time, label, context in events))
