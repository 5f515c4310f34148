"""The figures of a simulated human: what he holds, and what his joints do."""

import numpy as np

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


def _grip_panel(name: str, record: HumanRecord) -> Panel:
    grip = record.grips[name]
    force = np.where(grip.closed[:, None], grip.force, np.nan)
    size = np.linalg.norm(force, axis=1)
    axes = [Curve(axis, f"s{i}", grip.time, force[:, i]) for i, axis in enumerate("xyz")]
    return Panel(f"{name}: {grip.held}", (*axes, Curve("size", "s3", grip.time, size)))
