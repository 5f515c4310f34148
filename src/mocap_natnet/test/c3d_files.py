"""Writer of c3d files as laboratories make them, by ezc3d: z up, millimetres, force plates whose z points down."""

from dataclasses import dataclass, field
from pathlib import Path

import ezc3d
import numpy as np

RATE, PER_FRAME = 100.0, 10
"""Frame rate [Hz], and number of analog samples per frame."""
CORNERS = np.array([[900.0, 300.0, 0.0], [900.0, -300.0, 0.0], [500.0, -300.0, 0.0], [500.0, 300.0, 0.0]])
"""Corners of a plate of 0.6 x 0.4 m [mm]; its x is the laboratory's y, its y the laboratory's x, z points down."""
R_LAB_PLATE = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Rotation from the plate's axes to the laboratory's."""
ORIGIN = np.array([1.0, -2.0, -40.0])
"""Vector from the plate's electrical origin to the middle of its surface, in the plate's axes [mm]."""
CAL = np.diag([500.0, 510.0, 1000.0, 3e5, 2e5, 1e5]) + np.random.default_rng(5).normal(scale=2.0, size=(6, 6))
"""Calibration matrix of a plate of type 4 [N/V, N mm/V]."""


@dataclass
class Lab:
    """Contents of a c3d file.

    Attributes:
        markers: label -> positions, shape (frames, 3) [mm]; NaN: not seen.
        channels: label -> (unit, samples, shape (frames * PER_FRAME,)).
        plates: (type, wrench on its origin, in its axes, shape (frames * PER_FRAME, 6) [N, N mm]).
        parameters: further parameters, by (group, name).
    """

    markers: dict[str, np.ndarray]
    channels: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)
    plates: list[tuple[int, np.ndarray]] = field(default_factory=list)
    parameters: dict[tuple[str, str], object] = field(default_factory=dict)


def write(path: Path, lab: Lab) -> Path:
    """Write the c3d file."""
    file = ezc3d.c3d()
    point, analog = file["parameters"]["POINT"], file["parameters"]["ANALOG"]
    point["RATE"]["value"], point["UNITS"]["value"], point["LABELS"]["value"] = [RATE], ["mm"], list(lab.markers)
    if lab.markers:
        p = np.stack(list(lab.markers.values()), axis=1)
        points = np.ones((4, p.shape[1], p.shape[0]))
        points[:3] = p.transpose(2, 1, 0)
        file["data"]["points"] = points
        file["data"]["meta_points"]["residuals"] = np.where(np.isfinite(p).all(axis=2).T, 0.5, -1.0)[None]
    channels = dict(lab.channels)
    for number, (kind, wrench) in enumerate(lab.plates, 1):
        signals = wrench @ np.linalg.inv(CAL).T if kind == 4 else wrench
        units = ["V"] * 6 if kind == 4 else ["N"] * 3 + ["Nmm"] * 3
        for name, unit, values in zip(("Fx", "Fy", "Fz", "Mx", "My", "Mz"), units, signals.T, strict=True):
            channels[f"{name}{number}"] = (unit, values)
    analog["RATE"]["value"] = [RATE * PER_FRAME if channels else 0.0]
    analog["LABELS"]["value"], analog["UNITS"]["value"] = list(channels), [unit for unit, _ in channels.values()]
    if channels:
        file["data"]["analogs"] = np.stack([values for _, values in channels.values()])[None]
        if not lab.markers:
            file["data"]["points"] = np.ones((4, 0, file["data"]["analogs"].shape[2] // PER_FRAME))
    _plates(file, lab, len(lab.channels))
    for (group, name), value in lab.parameters.items():
        file.add_parameter(group, name, value)
    file.write(str(path))
    return path


def _plates(file: ezc3d.c3d, lab: Lab, first: int) -> None:
    count = len(lab.plates)
    if count:
        file.add_parameter("FORCE_PLATFORM", "USED", [count])
        file["parameters"]["FORCE_PLATFORM"]["USED"].update(type=2, value=np.array([count]))
        file["parameters"]["FORCE_PLATFORM"]["TYPE"].update(type=2, value=np.array([kind for kind, _ in lab.plates]))
        file.add_parameter("FORCE_PLATFORM", "CORNERS", np.repeat(CORNERS.T[:, :, None], count, axis=2))
        file.add_parameter("FORCE_PLATFORM", "ORIGIN", np.repeat(ORIGIN[:, None], count, axis=1))
        numbers = first + 1 + np.arange(6 * count).reshape(count, 6).T
        file["parameters"]["FORCE_PLATFORM"]["CHANNEL"].update(type=2, value=numbers)
        file.add_parameter("FORCE_PLATFORM", "CAL_MATRIX", np.repeat(CAL[:, :, None], count, axis=2))


def swinging(frames: int) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Return markers [mm], positions, shape (frames, 3) [m], and rotations, shape (frames, 3, 3), of a rigid body."""
    from scipy.spatial.transform import Rotation

    t = np.arange(frames) / RATE
    p = np.column_stack([0.6 + 0.1 * np.sin(3 * t), 0.1 * np.cos(2 * t), 0.5 + 0.05 * t])
    R = Rotation.from_rotvec(np.column_stack([0.3 * np.sin(2 * t), 0.5 * t, 0.2 * t])).as_matrix()
    body = np.array([[0.05, 0.0, 0.01], [-0.03, 0.04, 0.0], [-0.02, -0.05, 0.02], [0.01, 0.02, 0.06]])
    body -= body.mean(axis=0)
    return {f"hand_{k}": 1000.0 * (p + R @ point) for k, point in enumerate(body, 1)}, p, R
