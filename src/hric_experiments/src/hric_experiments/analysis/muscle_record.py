"""What the muscles of a simulated human did in a run, from the topics in its bag. No ROS.

All of it is an estimate of a model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.reader import FloatArray

TOPICS = {
    "activation": "hric_msgs/msg/MuscleActivation",
    "muscle_force": "hric_msgs/msg/MuscleForce",
    "joint_reactions": "hric_msgs/msg/JointReactions",
}
"""Below the human's name, with their types."""
THRESHOLDS = (0.3, 0.5)
"""Activations of which the share of time above them is told [1]: project defaults, unconfirmed."""
NAMED = 3
"""So many muscles are named in the text of a report."""


@dataclass(frozen=True)
class MuscleRecord:
    """Of one run.

    Attributes:
        names: of k muscles, and of ideal actuators of joints without any.
        is_muscle: of each, whether it is one.
        time: robot time, shape (n,) [s].
        activation: shape (n, k) [1].
        limited: by name, how often all was required of it.
        force: largest of each muscle, by name [N].
        outside: share of the time in which the posture was outside the range of muscle paths [1].
        contact_time: of the rows of `contact`, shape (m,) [s].
        contact: size of the contact force, by joint centre, shape (m,) [N].
    """

    names: tuple[str, ...]
    is_muscle: npt.NDArray[np.bool_]
    time: FloatArray
    activation: FloatArray
    limited: dict[str, int]
    force: dict[str, float]
    outside: float
    contact_time: FloatArray
    contact: dict[str, FloatArray]

    @property
    def muscles(self) -> tuple[str, ...]:
        """Names of muscles alone."""
        return tuple(name for name, own in zip(self.names, self.is_muscle, strict=True) if own)


def made(rows: Mapping[str, Sequence[tuple[float, Any]]]) -> MuscleRecord | None:
    """From messages with their robot times [s], by the keys of TOPICS; None: his joints have no muscles."""
    activations, forces, reactions = (rows[topic] for topic in TOPICS)
    if not activations or not forces:
        return None
    names, muscles = tuple(activations[0][1].name), list(forces[0][1].name)
    largest = np.max([message.force for _, message in forces], axis=0)
    contact = {}
    for index, joint in enumerate(reactions[0][1].joint_names if reactions else ()):
        found = [message.wrenches[index].force for _, message in reactions]
        contact[joint] = np.linalg.norm([(f.x, f.y, f.z) for f in found], axis=1)
    return MuscleRecord(
        names,
        np.isin(names, muscles),
        np.array([time for time, _ in activations]),
        np.array([message.activation for _, message in activations]),
        dict(zip(names, map(int, activations[-1][1].limited), strict=True)),
        dict(zip(muscles, map(float, largest), strict=True)),
        float(np.mean([message.outside for _, message in forces])),
        np.array([time for time, _ in reactions]),
        contact,
    )


def metrics(record: MuscleRecord) -> dict[str, Any]:
    """For metrics.json."""
    own = record.activation[:, record.is_muscle]
    names = record.muscles
    return {
        "activation_max": float(own.max()),
        "activation_max_muscle": names[int(own.max(axis=0).argmax())],
        "activation_mean": float(own.mean()),
        "above": {f"{level:g}": float((own.max(axis=1) > level).mean()) for level in THRESHOLDS},
        "outside": record.outside,
        "muscles": {
            name: {
                "activation_max": float(values.max()),
                "activation_mean": float(values.mean()),
                "above": {f"{level:g}": float((values > level).mean()) for level in THRESHOLDS},
                "force_max": record.force[name],
                "limited": record.limited[name],
            }
            for name, values in zip(names, own.T, strict=True)
        },
        "contact": {
            joint: {"force_max": float(size.max()), "force_mean": float(size.mean())}
            for joint, size in record.contact.items()
        },
    }


def render(found: Mapping[str, Any]) -> list[str]:
    """As lines for the report; found: of `metrics`."""
    muscles = found["muscles"]
    hardest = sorted(muscles, key=lambda name: -muscles[name]["activation_max"])[:NAMED]
    named = ", ".join(f"{name} {muscles[name]['activation_max']:.2f}" for name in hardest)
    above = ", ".join(f"above {level} for {100 * share:.0f} % of the time" for level, share in found["above"].items())
    lines = [
        f"- muscles: activation at most {named}; {found['activation_mean']:.3f} in the mean of all; one of them {above}"
    ]
    if found["contact"]:
        sizes = (f"{joint} {size['force_max']:.0f} N at most" for joint, size in found["contact"].items())
        lines.append(f"- contact force between his bones: {', '.join(sizes)}")
    if limited := {name: one["limited"] for name, one in muscles.items() if one["limited"]}:
        counts = ", ".join(f"{name} ({n} times)" for name, n in limited.items())
        lines.append(f"- muscles that gave all that they can: {counts}")
    if found["outside"] > 0.0:
        lines.append(
            f"- for {100 * found['outside']:.0f} % of the time his posture was outside the range of muscle paths: "
            "muscles are those of its edge then"
        )
    return lines
