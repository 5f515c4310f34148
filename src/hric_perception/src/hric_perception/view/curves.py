"""Curves of the last seconds: samples of messages, and their picture. Matplotlib, no ROS."""

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

WINDOW = 10.0
"""Shown time span [s]; project default, unconfirmed."""
Sample = tuple[tuple[str, ...], tuple[float, ...], str]
"""Names of curves, their values, and their unit."""


@dataclass(frozen=True)
class Panel:
    """Description of one set of axes.

    Attributes:
        title: title of the axes.
        topic: topic in the namespace of the robot.
        read: function from a message to its sample.
    """

    title: str
    topic: str
    read: Callable[[Any], Sample]


def _joints(field: str, unit: str) -> Callable[[Any], Sample]:
    return lambda message: (tuple(message.name), tuple(getattr(message, field)), unit)


def _wrench(message: Any) -> Sample:
    force = message.wrench.force
    return ("force x", "force y", "force z"), (force.x, force.y, force.z), "N"


def _chunk(message: Any) -> Sample:
    words = message.unit.split()
    unit = ", ".join(dict.fromkeys(word.replace("*", " ") for word in words))
    return tuple(message.channels), tuple(message.data[-len(message.channels) :]), unit


def panels(plate: str = "1") -> dict[str, Panel]:
    """Return the panels by name; plate: name of the force plate."""
    return {
        "positions": Panel("joint positions", "hric/view/joints", _joints("position", "rad")),
        "velocities": Panel("joint velocities", "hric/view/joints", _joints("velocity", "rad/s")),
        "efforts": Panel("joint efforts, gravity included", "hric/view/joints", _joints("effort", "N m")),
        "wrench": Panel("estimated force on the arm", "hric/view/arm_wrench", _wrench),
        "emg": Panel("EMG envelope", "hric/view/emg", _chunk),
        "plate": Panel(f"force plate {plate}", f"hric/view/force_plate/{plate}/wrench", _wrench),
    }


class History:
    """Samples of the last seconds; thread-safe.

    Args:
        window: stored time span [s].
    """

    def __init__(self, window: float = WINDOW) -> None:
        self._window, self._lock = window, threading.Lock()
        self._names: tuple[str, ...] = ()
        self._unit = ""
        self._times: deque[float] = deque()
        self._rows: deque[tuple[float, ...]] = deque()

    def add(self, time: float, sample: Sample) -> None:
        """Add a sample; time: its stamp [s]. Other names, or a time that goes back, restart the history."""
        names, values, unit = sample
        if len(values) != len(names):
            return
        with self._lock:
            if names != self._names or (self._times and time < self._times[-1]):
                self._times.clear()
                self._rows.clear()
            self._names, self._unit = names, unit
            self._times.append(time)
            self._rows.append(values)
            while self._times[0] < time - self._window:
                self._times.popleft()
                self._rows.popleft()

    def read(self) -> tuple[tuple[str, ...], str, Any, Any]:
        """Return names, unit, times (n,) [s] and values (n, names)."""
        with self._lock:
            return (
                self._names,
                self._unit,
                np.array(self._times),
                np.array(self._rows).reshape(len(self._rows), len(self._names)),
            )


class Picture:
    """Axes that follow their histories.

    Args:
        figure: figure to draw in.
        shown: panels, from top to bottom.
        histories: one per panel.
    """

    def __init__(self, figure: Any, shown: Sequence[Panel], histories: Mapping[str, History]) -> None:
        self._figure, self._histories = figure, [(panel, histories[panel.title]) for panel in shown]
        self._axes = figure.subplots(len(shown), 1, squeeze=False)[:, 0]
        self._lines: list[dict[str, Any]] = [{} for _ in shown]
        for axes, panel in zip(self._axes, shown, strict=True):
            axes.set_title(panel.title, fontsize=9, loc="left")
            axes.grid(alpha=0.3)
        self._axes[-1].set_xlabel("robot time [s]")

    def update(self) -> None:
        """Update the curves with new samples."""
        found = [history.read() for _, history in self._histories]
        newest = max((times[-1] for *_, times, _ in found if len(times)), default=0.0)
        for axes, lines, (panel, _), (names, unit, times, values) in zip(
            self._axes, self._lines, self._histories, found, strict=True
        ):
            if tuple(lines) != names:
                _begin(axes, lines, names, unit)
            if not len(times):
                axes.set_title(f"{panel.title}: nothing on {panel.topic} yet", fontsize=9, loc="left")
                continue
            axes.set_title(panel.title, fontsize=9, loc="left")
            for line, column in zip(lines.values(), values.T, strict=True):
                line.set_data(times, column)
            axes.set_xlim(newest - WINDOW, newest)
            axes.relim()
            axes.autoscale_view(scalex=False)


def _begin(axes: Any, lines: dict[str, Any], names: Sequence[str], unit: str) -> None:
    """Begin with new curves."""
    for line in axes.get_lines():
        line.remove()
    lines.clear()
    axes.set_prop_cycle(None)
    lines.update({name: axes.plot([], [], label=name, linewidth=1.0)[0] for name in names})
    axes.set_ylabel(f"[{unit}]")
    if names:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7, frameon=False)
