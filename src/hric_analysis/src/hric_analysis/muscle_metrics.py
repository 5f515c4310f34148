"""Muscle metrics of a run's simulated human; all values are estimates of a model. No ROS."""

from dataclasses import dataclass

import numpy as np

from hric_bags.reader import FloatArray
from hric_bags.records.muscle_record import MuscleRecord

THRESHOLDS = (0.3, 0.5)
"""Activation thresholds [1]; the share of time above each is reported. Project defaults, unconfirmed."""


@dataclass(frozen=True)
class ContactSize:
    """Magnitude of the contact force between the bones of a joint.

    Attributes:
        force_max, force_mean: largest and mean force [N].
    """

    force_max: float
    force_mean: float


@dataclass(frozen=True)
class MuscleMetrics:
    """Activation and force of one muscle during a run.

    Attributes:
        activation_max, activation_mean: largest and mean activation [1].
        above: share of the time with an activation above the threshold [1], by threshold.
        force_max: largest force [N].
        limited: number of times that the muscle was saturated at maximum strength.
    """

    activation_max: float
    activation_mean: float
    above: dict[str, float]
    force_max: float
    limited: int


@dataclass(frozen=True)
class MusclesMetrics:
    """Activation of all muscles during a run, and contact forces in joints.

    Attributes:
        activation_max: largest activation of a muscle [1].
        activation_max_muscle: name of that muscle.
        activation_mean: mean activation over all muscles [1].
        above: share of the time in which any muscle has an activation above the threshold [1], by threshold.
        outside: share of the time in which the posture was outside the range of the muscle paths [1].
        muscles: metrics by muscle.
        contact: contact forces by joint.
    """

    activation_max: float
    activation_max_muscle: str
    activation_mean: float
    above: dict[str, float]
    outside: float
    muscles: dict[str, MuscleMetrics]
    contact: dict[str, ContactSize]


def metrics(record: MuscleRecord) -> MusclesMetrics:
    """Return the metrics of recorded muscle activations and forces."""
    activation, names = record.activation[:, record.is_muscle], record.muscles
    return MusclesMetrics(
        float(activation.max()),
        names[int(activation.max(axis=0).argmax())],
        float(activation.mean()),
        _above(activation.max(axis=1)),
        record.outside,
        {
            name: MuscleMetrics(
                float(values.max()), float(values.mean()), _above(values), record.force[name], record.limited[name]
            )
            for name, values in zip(names, activation.T, strict=True)
        },
        {joint: ContactSize(float(size.max()), float(size.mean())) for joint, size in record.contact.items()},
    )


def _above(activation: FloatArray) -> dict[str, float]:
    """Return the share of samples above each threshold, by threshold; activation: shape (n,) [1]."""
    return {f"{level:g}": float(np.mean(activation > level)) for level in THRESHOLDS}
