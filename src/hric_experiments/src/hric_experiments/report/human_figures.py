"""The figures of a simulated human: what he holds, and what his joints do."""

import numpy as np

from hric_experiments.analysis.carrying import Carried
from hric_experiments.analysis.human import Person
from hric_experiments.analysis.human_record import HumanRecord
from hric_experiments.report import sections
from hric_experiments.report.figure import Curve, Figure, Panel, per_joint

ESTIMATE = "A model's estimate, not a measurement of a person."


def human_figures(person: Person | None) -> list[Figure]:
    """Of a run; none without a human."""
    if person is None:
        return []
    record = person.record
    found = []
    if panels := [_grip_panel(name, record) for name, grip in record.grips.items() if grip.closed.any()]:
        forces = Figure("grip", "Grip force", "force on the hand [N]", tuple(panels), min_height=1.0)
        found.append(forces.about(sections.HUMAN, f"Force of what is held on what holds it. {ESTIMATE}"))
    for k, one in enumerate(person.carried):
        suffix = f"_{k + 1}" if len(person.carried) > 1 else ""
        found += [_carrying(one, f"carrying{suffix}"), _path(one, f"carrying_path{suffix}")]
    share = Curve("of the strength", "measured", record.torque_time, record.share)
    strength = per_joint(
        "strength",
        "Torque of the human's joints as share of their strength",
        "share [1]",
        record.joints,
        [share],
        lambda joint: (("strength", 1.0),),
        min_height=0.1,
    )
    angles = per_joint(
        "human_joints",
        "Joints of the human",
        "angle [rad]",
        record.joints,
        [Curve("angle", "measured", record.time, record.position)],
        min_height=0.02,
    )
    return [
        *found,
        strength.about(sections.HUMAN, f"In the sense in which the torque acts. {ESTIMATE}"),
        angles.about(sections.HUMAN, "Joint angles of the simulated body."),
    ]


def _carrying(one: Carried, key: str) -> Figure:
    """Load share, squeeze and tilt over time."""
    panels = []
    if one.share is not None:
        shares = zip(one.ends, one.share, strict=True)
        curves = tuple(Curve(name, f"s{k}", one.time, 100.0 * share) for k, (name, share) in enumerate(shares))
        panels.append(Panel("load share", curves, unit="of the weight [%]"))
    panels.append(Panel("squeeze", (Curve("both together", "s2", one.time, one.squeeze),), unit="force [N]"))
    panels.append(Panel("tilt", (Curve("both together", "s2", one.time, np.rad2deg(one.tilt)),), unit="angle [deg]"))
    a, b = one.ends
    caption = (
        f"Vertical force of the grips {a} and {b} on {one.body} over its weight; what of both forces cancels along the "
        "line between the grips (positive: it is squeezed, negative: it is stretched); how far that line is out of the "
        f"horizontal (positive: {b} is higher). {ESTIMATE}"
    )
    return Figure(key, f"{one.body}, carried by two", "", tuple(panels), min_height=1.0, columns=3).about(
        sections.HUMAN, caption
    )


def _path(one: Carried, key: str) -> Figure:
    """Both ends and their middle, each from where it began: the ends are far apart beside their path."""
    points = [*zip(one.ends, ("s0", "s1"), one.point, strict=True), ("middle of both", "s2", one.centre)]
    moved = [(name, role, point - point[0]) for name, role, point in points]
    panels = tuple(
        Panel(
            title,
            tuple(Curve(name, role, path[:, i], path[:, j]) for name, role, path in moved),
            unit=f"{'xyz'[j]} [m]",
            abscissa=f"{'xyz'[i]} [m]",
        )
        for title, i, j in (("from above", 0, 1), ("from the side", 0, 2), ("along x", 1, 2))
    )
    caption = f"How far both ends of {one.body} and their middle went from where they were, seen along each axis."
    extent = max(float(np.ptp(path, axis=0).max()) for _, _, path in moved)
    figure = Figure(key, f"Path of {one.body}", "", panels, max(extent, 0.02), columns=3, equal=True)
    return figure.about(sections.HUMAN, caption)


def _grip_panel(name: str, record: HumanRecord) -> Panel:
    grip = record.grips[name]
    force = np.where(grip.closed[:, None], grip.force, np.nan)
    size = np.linalg.norm(force, axis=1)
    axes = [Curve(axis, f"s{i}", grip.time, force[:, i]) for i, axis in enumerate("xyz")]
    return Panel(f"{name}: {grip.held}", (*axes, Curve("size", "s3", grip.time, size)))
