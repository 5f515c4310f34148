"""Figures of what the sensors measured: which part of the report a topic belongs to, and what it is called there."""

import re
from collections.abc import Iterable

from hric_experiments.analysis.recordings import Signal
from hric_experiments.report import sections
from hric_experiments.report.figure import Curve, Figure, Panel

KNOWN = (
    (r"/emg/raw$", sections.EMG, "Muscle activity", "EMG as the device sent it, one panel per muscle."),
    (r"/emg/envelope$", sections.EMG, "Envelope of the muscle activity", "Rectified and low-pass filtered EMG."),
    (r"/view/emg$", sections.EMG, "Envelope of the muscle activity, as viewed", "The envelope that a viewer got."),
    (
        r"/force_plate/([^/]+)/wrench$",
        sections.PLATE,
        r"Load on force plate \1",
        "Force and moment about the middle of the surface, mean of each message.",
    ),
    (
        r"/force_plate/([^/]+)/samples$",
        sections.PLATE,
        r"Samples of force plate \1",
        "Channels of the plate as the device sent them.",
    ),
    (
        r"/force_plate/([^/]+)/cop$",
        sections.PLATE,
        r"Centre of pressure on force plate \1",
        "From the middle of the surface, while the vertical force is above 20 N.",
    ),
    (
        r"/F_ext$",
        sections.FORCES,
        "External wrench on the end effector",
        "Estimated by the robot, in its stiffness frame.",
    ),
    (r"/arm_wrench$", sections.FORCES, "External wrench, as viewed", "The estimate that a viewer got."),
    (
        r"/commanded_wrench$",
        sections.FORCES,
        "Wrench of the controller's spring and damper",
        "In the axes of the robot's base.",
    ),
    (
        r"/mocap/marker_stamped$",
        sections.TRACKING,
        "Position of the marker",
        "Position of the body that the motion capture tracked.",
    ),
)
"""Of a topic: a pattern of its name, the part of the report, its figure's title and caption."""
TOGETHER = 3
"""Channels of one unit that share a panel at most: those of a vector."""


def signal_figures(signals: Iterable[Signal]) -> list[Figure]:
    """One figure per topic: channels of a vector in one panel, those of a sensor with many in one each."""
    by_topic: dict[str, list[Signal]] = {}
    for signal in signals:
        by_topic.setdefault(signal.topic, []).append(signal)
    found = [_figure(topic, parts) for topic, parts in by_topic.items()]
    return sorted(found, key=lambda figure: sections.ORDER.index(figure.section))


def _figure(topic: str, signals: Iterable[Signal]) -> Figure:
    section, title, caption = _about(topic)
    panels: list[Panel] = []
    for signal in signals:
        curves = [Curve(name, f"s{k % 10}", signal.time, signal.values[:, k]) for k, name in enumerate(signal.channels)]
        if len(curves) <= TOGETHER:
            panels.append(Panel(signal.unit.partition(" [")[0].strip("[]"), tuple(curves), unit=signal.unit))
        else:
            alone = (Curve("sample", "measured", curve.time, curve.values) for curve in curves)
            named = zip(signal.channels, alone, strict=True)
            panels += [Panel(name, (curve,), unit=signal.unit) for name, curve in named]
    key = topic.strip("/").replace("/", ".")
    return Figure(key, title, "", tuple(panels), section=section, caption=f"{caption} Topic {topic}.")


def _about(topic: str) -> tuple[str, str, str]:
    """Part of the report, title and caption; of a topic that is not known, its name is the title."""
    for pattern, section, title, caption in KNOWN:
        found = re.search(pattern, topic)
        if found:
            return section, found.expand(title), caption
    return sections.OTHER, topic, "As it was recorded."
