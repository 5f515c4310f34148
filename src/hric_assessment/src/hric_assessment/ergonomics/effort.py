"""What a hand did with what it held: force and work of a grip. Descriptions, without a limit."""

from dataclasses import dataclass

import numpy as np

from hric_bags.records.human_record import GripRecord


@dataclass(frozen=True)
class Effort:
    """Of one grip.

    Attributes:
        closed: for how long [s].
        force_max, force_max_time: largest force, and when [N], [s].
        force_mean: while it was closed [N].
        torque_max: [N m].
        work: of the holder on what it holds [J].
        work_absolute: what goes to and fro added up [J].
    """

    closed: float
    force_max: float
    force_max_time: float
    force_mean: float
    torque_max: float
    work: float
    work_absolute: float


def effort(grip: GripRecord) -> Effort | None:
    """None: it never closed."""
    size, held = np.linalg.norm(grip.force, axis=1), grip.closed
    if not held.any():
        return None
    velocity = np.gradient(np.where(held[:, None], grip.point, np.nan), grip.time, axis=0)
    power = np.nan_to_num(-np.einsum("ij,ij->i", grip.force, velocity))
    return Effort(
        float(held.mean() * (grip.time[-1] - grip.time[0])),
        float(size.max()),
        float(grip.time[size.argmax()]),
        float(size[held].mean()),
        float(np.linalg.norm(grip.torque, axis=1).max()),
        float(np.trapezoid(power, grip.time)),
        float(np.trapezoid(np.abs(power), grip.time)),
    )
