"""Figures of what the sensors measured, by their meaning."""

from collections.abc import Iterable

from hric_analysis.recordings import Signal
from hric_report import sections
from hric_report.figure import Curve, Figure, Panel

TOGETHER = 3
"""Channels of one unit that share a panel at most: those of a vector."""
QUANTITIES = {"V": "voltage", "N": "force", "N m": "moment", "m": "position", "MVC": "activation"}
"""What is measured in a unit, where a topic has the unit alone."""


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
    return in_order([_figure(topic, parts) for topic, parts in by_topic.items()])


def in_order(figures: Iterable[Figure]) -> list[Figure]:
    """Return figures in the order of the report's parts."""
    return sorted(figures, key=lambda figure: sections.ORDER.index(figure.section))


def _figure(topic: str, signals: Iterable[Signal]) -> Figure:
    section, title, caption = sections.of_topic(topic)
    roles: dict[str, str] = {}
    panels = tuple(panel for signal in signals for panel in _panels(signal, roles))
    key = topic.strip("/").replace("/", ".")
    return Figure(key, title, "", panels).about(section, f"{caption} Topic {topic}.")


def _panels(signal: Signal, roles: dict[str, str]) -> list[Panel]:
    """Of the channels of one unit; roles: of the names in the figure's legend, which it gets."""
    quantity, _, unit = signal.unit.rpartition("[")
    quantity = quantity.strip() or QUANTITIES.get(unit.rstrip("]"), "")
    label = f"{quantity} [{unit}".strip()
    columns = list(zip(signal.channels, signal.values.T, strict=True))
    if len(columns) > TOGETHER:
        return [Panel(name, (Curve("sample", "measured", signal.time, one),), unit=label) for name, one in columns]
    curves = []
    for channel, values in columns:
        name = channel.removeprefix(f"{quantity} ")
        role = roles.setdefault(name, f"s{len(roles) % 10}")
        curves.append(Curve(name, role, signal.time, values))
    return [Panel(quantity, tuple(curves), unit=label)]
