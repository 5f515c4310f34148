"""Figures of the sensor signals, one per topic, in the section of the report that suits the topic."""

from collections.abc import Iterable

from hric_analysis.recordings import Signal
from hric_report import sections
from hric_report.figure import Curve, Figure, Panel
from hric_report.figures import FigureData

TOGETHER = 3
"""Maximum number of channels of one unit that share a panel, such as the components of a vector."""
QUANTITIES = {"V": "voltage", "N": "force", "N m": "moment", "m": "position", "MVC": "activation"}
"""Name of the quantity by unit, for topics that give only the unit of their values."""


def figures(data: FigureData) -> list[Figure]:
    """Return one figure per topic; up to TOGETHER channels of one unit share a panel, more get one panel each."""
    by_topic: dict[str, list[Signal]] = {}
    for signal in data.signals:
        by_topic.setdefault(signal.topic, []).append(signal)
    return [_figure(topic, parts) for topic, parts in by_topic.items()]


def _figure(topic: str, signals: Iterable[Signal]) -> Figure:
    section, title, caption = sections.of_topic(topic)
    roles: dict[str, str] = {}
    panels = tuple(panel for signal in signals for panel in _panels(signal, roles))
    key = topic.strip("/").replace("/", ".")
    return Figure(key, title, "", panels).about(section, f"{caption} Topic {topic}.")


def _panels(signal: Signal, roles: dict[str, str]) -> list[Panel]:
    """Return the panels of a signal, whose channels have one unit; adds new legend names with roles to `roles`."""
    quantity, _, unit = signal.unit.rpartition("[")
    quantity = quantity.strip() or QUANTITIES.get(unit.rstrip("]"), "")
    label = f"{quantity} [{unit}".strip()
    columns = list(zip(signal.channels, signal.values.T, strict=True))
    if len(columns) > TOGETHER:
        return [
            Panel(name, (Curve("sample", "measured", signal.time, column),), unit=label) for name, column in columns
        ]
    curves = []
    for channel, values in columns:
        name = channel.removeprefix(f"{quantity} ")
        curves.append(Curve(name, roles.setdefault(name, f"s{len(roles) % 10}"), signal.time, values))
    return [Panel(quantity, tuple(curves), unit=label)]
