"""Figures of what the sensors measured, by their meaning."""

from collections.abc import Iterable

from hric_experiments.analysis.recordings import Signal
from hric_experiments.report import sections
from hric_experiments.report.figure import Curve, Figure, Panel

TOGETHER = 3
"""Channels of one unit that share a panel at most: those of a vector."""


def signal_figures(signals: Iterable[Signal]) -> list[Figure]:
    """One figure per topic: channels of a vector in one panel, those of a sensor with many in one each.

    Args:
        signals: one or more per topic, by their units.

    Returns:
        The figures in the order of the report's parts.
    """
    by_topic: dict[str, list[Signal]] = {}
    for signal in signals:
        by_topic.setdefault(signal.topic, []).append(signal)
    found = [_figure(topic, parts) for topic, parts in by_topic.items()]
    return sorted(found, key=lambda figure: sections.ORDER.index(figure.section))


def _figure(topic: str, signals: Iterable[Signal]) -> Figure:
    section, title, caption = sections.of_topic(topic)
    panels = tuple(panel for signal in signals for panel in _panels(signal))
    key = topic.strip("/").replace("/", ".")
    return Figure(key, title, "", panels).about(section, f"{caption} Topic {topic}.")


def _panels(signal: Signal) -> list[Panel]:
    """Of the channels of one unit."""
    columns = list(zip(signal.channels, signal.values.T, strict=True))
    if len(columns) <= TOGETHER:
        title = signal.unit.partition(" [")[0].strip("[]")
        curves = (Curve(name, f"s{k}", signal.time, values) for k, (name, values) in enumerate(columns))
        return [Panel(title, tuple(curves), unit=signal.unit)]
    return [
        Panel(name, (Curve("sample", "measured", signal.time, values),), unit=signal.unit) for name, values in columns
    ]
