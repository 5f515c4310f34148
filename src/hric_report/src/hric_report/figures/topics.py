"""Sensor signals by topic, assigned to sections of the report."""

from collections.abc import Iterable

from hric_analysis.recordings import Signal
from hric_report import sections
from hric_report.figure import Curve, Figure, Panel
from hric_report.figures import FigureData

TOGETHER = 3
"""Maximum number of channels of one unit that share a panel: those of a vector."""
QUANTITIES = {"V": "voltage", "N": "force", "N m": "moment", "m": "position", "MVC": "activation"}
"""Quantity by unit, for topics that name only the unit."""


def figures(data: FigureData) -> list[Figure]:
    """Return one figure per topic: the channels of a vector share a panel, many channels get a panel each."""
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
    """Return the panels of the channels of one unit; adds new legend names with their roles to `roles`."""
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
        role = roles.setdefault(name, f"s{len(roles) % 10}")
        curves.append(Curve(name, role, signal.time, values))
    return [Panel(quantity, tuple(curves), unit=label)]
