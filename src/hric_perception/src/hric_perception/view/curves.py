"""Curves of the last seconds of a run: samples read from messages, drawn by Matplotlib. No ROS node."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from hric_msgs.msg import SampleChunk
from hric_perception.replayed import RecentRows

WINDOW = 10.0
"""Time span that the curves show [s]; project default, unconfirmed."""
Sample = tuple[tuple[str, ...], tuple[float, ...], str]
"""Sample of one panel at one time: names of its curves, their values, and their unit."""


class CurvePanel(NamedTuple):
    """Description of one panel of the live plot: a set of axes with the curves of one topic.

    Attributes:
        title: title of the panel.
        topic, type: topic in the robot's namespace, and its message type.
        read: function from a message to its sample.
    """

    title: str
    topic: str
    type: type
    read: Callable[[Any], Sample]


def _joints(title: str, field: str, unit: str) -> CurvePanel:
    return CurvePanel(
        title,
        "hric/view/joints",
        JointState,
        lambda message: (tuple(message.name), tuple(getattr(message, field)), unit),
    )


def _wrench(message: Any) -> Sample:
    force = message.wrench.force
    return ("force x", "force y", "force z"), (force.x, force.y, force.z), "N"


def _chunk(message: Any) -> Sample:
    unit = ", ".join(dict.fromkeys(word.replace("*", " ") for word in message.unit.split()))
    return tuple(message.channels), tuple(message.data[-len(message.channels) :]), unit


def panels(plate: str = "1") -> dict[str, CurvePanel]:
    """Return all panels of the live plot by name; plate: name of the force plate."""
    return {
        "positions": _joints("joint positions", "position", "rad"),
        "velocities": _joints("joint velocities", "velocity", "rad/s"),
        "efforts": _joints("joint efforts, gravity included", "effort", "N m"),
        "wrench": CurvePanel("estimated force on the arm", "hric/view/arm_wrench", WrenchStamped, _wrench),
        "emg": CurvePanel("EMG envelope", "hric/view/emg", SampleChunk, _chunk),
        "plate": CurvePanel(f"force plate {plate}", f"hric/view/force_plate/{plate}/wrench", WrenchStamped, _wrench),
    }


class SampleHistory(RecentRows[Sample]):
    """Samples of one panel in the last WINDOW seconds."""

    def __init__(self) -> None:
        super().__init__(WINDOW)

    def read(self) -> tuple[tuple[str, ...], str, Any, Any]:
        """Return names and unit of the newest sample, and times (n,) [s] and values (n, names) of samples like it."""
        rows = self.rows()
        names, _, unit = rows[-1][1] if rows else ((), (), "")
        alike = [
            (time, values) for time, (row_names, values, _) in rows if row_names == names and len(values) == len(names)
        ]
        values = np.array([row for _, row in alike]).reshape(len(alike), len(names))
        return names, unit, np.array([time for time, _ in alike]), values


def draw(all_axes: Sequence[Any], shown: Sequence[CurvePanel], histories: Sequence[SampleHistory]) -> None:
    """Draw the curves of the shown panels into their axes, from top to bottom."""
    curves = [history.read() for history in histories]
    newest = max((times[-1] for *_, times, _ in curves if len(times)), default=0.0)
    for axes, panel, (names, unit, times, values) in zip(all_axes, shown, curves, strict=True):
        axes.clear()
        axes.grid(alpha=0.3)
        nothing = "" if len(times) else f": no message on {panel.topic} yet"
        axes.set_title(f"{panel.title}{nothing}", fontsize=9, loc="left")
        if names and len(times):
            for name, column in zip(names, values.T, strict=True):
                axes.plot(times, column, label=name, linewidth=1.0)
            axes.set_xlim(newest - WINDOW, newest)
            axes.set_ylabel(f"[{unit}]")
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7, frameon=False)
    all_axes[-1].set_xlabel("robot time [s]")
