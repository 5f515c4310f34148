"""Muscle metrics of the simulated human of a run: estimates of a model. No ROS."""

from collections.abc import Mapping
from typing import Any

from hric_bags.records.muscle_record import MuscleRecord

THRESHOLDS = (0.3, 0.5)
"""Activations for which the share of time above them is reported [1]; project defaults, unconfirmed."""
NAMED = 3
"""Number of muscles that are named in the text of a report."""


def metrics(record: MuscleRecord) -> dict[str, Any]:
    """Return the metrics for metrics.json."""
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
    """Return the lines of the report from the result of `metrics`."""
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
