"""Force plates as c3d files have them: corners, origin, signals, calibration."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hric_bags.export.frames import Frames
from hric_bags.export.table import FloatArray, Table
from hric_perception.plate.geometry import PLATE_SIZE

FLIP = np.diag([1.0, -1.0, -1.0])
"""From axes of a plate with z up to those of a c3d file, z down, and back."""
QUADRANTS = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
"""Of the corners, in the axes of the file's plate (c3d.org, FORCE_PLATFORM:CORNERS)."""
N_MM = np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])
"""N and N m as N and N mm."""


@dataclass(frozen=True)
class PlateSettings:
    """Settings of a plate in a run (keys of `force_plate` in an experiment file).

    Attributes:
        size: of the surface along x and y [m].
        height: of the surface over the origin of the moments [m].
        invert: the device measures the reaction, not the load.
        calibration: (Fx .. Mz) = calibration @ signals, shape (6, 6) [N/V, N m/V]; None: the device sends forces.
    """

    size: tuple[float, float] = PLATE_SIZE
    height: float = 0.0
    invert: bool = False
    calibration: FloatArray | None = None

    def over(self, surface: float) -> "PlateSettings":
        """The same with another height, where one is given."""
        return replace(self, height=surface) if surface else self


@dataclass(frozen=True)
class C3dPlate:
    """A plate of a c3d file.

    Attributes:
        name: of it.
        kind: type, 2 or 4.
        corners: in OpenSim's ground, shape (4, 3) [m].
        origin: from the origin of the moments to the middle of the surface, in the file's axes of the plate, shape (3,)
            [m].
        calibration: shape (6, 6) [N/V, N mm/V]; the identity for type 2.
        units: of its six channels.
        axes: how its pose was found, for people.
    """

    name: str
    kind: int
    corners: FloatArray
    origin: FloatArray
    calibration: FloatArray
    units: tuple[str, ...]
    axes: str


def plate_settings(run: Mapping[str, Any]) -> dict[str, PlateSettings]:
    """Of the plates in run.yaml, by name."""
    section = (run.get("definition") or {}).get("force_plate") or {}
    if not section:
        return {}
    driver, described = section.get("driver") or {}, section.get("described") or {}
    size, calibration = described.get("size", PLATE_SIZE), described.get("calibration")
    settings = PlateSettings(
        (float(size[0]), float(size[1])),
        float(driver.get("height", 0.0)),
        bool(driver.get("invert", False)),
        None if calibration is None else np.array(calibration, dtype=float),
    )
    return {str(driver.get("id", "1")): settings}


def plate_of(table: Table, frames: Frames, settings: PlateSettings, wrench: FloatArray) -> tuple[C3dPlate, FloatArray]:
    """(the plate, its signals, shape (n, 6)).

    A c3d file has what the plate does to the body on it, in axes with z down: BTK, OpenSim and ezc3d take its channels
    so, without a change of sign.

    Args:
        table: of the samples.
        frames: where the plate's frame is: at the middle of the surface, z up.
        settings: see there.
        wrench: samples as the device sends them, shape (n, 6) [N, N m].
    """
    from hric_bags.export.opensim_formats import plate_name

    T, axes = frames.in_ground(table.frame)
    R_ground_file = T[:3, :3] @ FLIP
    half = np.array([*settings.size, 0.0]) / 2
    corners = T[:3, 3] + (QUADRANTS * half) @ R_ground_file.T
    to_file = np.kron(np.eye(2), (1.0 if settings.invert else -1.0) * FLIP) * N_MM[:, None]
    if settings.height < 0:
        # Readers take an origin above the surface for a wrong sign: the moments are taken to the surface instead.
        to_file = to_file @ _at_surface(settings.height)
    origin = np.array([0.0, 0.0, -max(settings.height, 0.0)])
    if settings.calibration is None:
        plate = C3dPlate(plate_name(table), 2, corners, origin, np.eye(6), ("N",) * 3 + ("Nmm",) * 3, axes)
        return plate, np.asarray(wrench @ to_file.T)
    signals = np.asarray(np.linalg.solve(settings.calibration, wrench.T).T, dtype=float)
    return C3dPlate(plate_name(table), 4, corners, origin, to_file @ settings.calibration, ("V",) * 6, axes), signals


def _at_surface(height: float) -> FloatArray:
    """M' = M + F x p with p = (0, 0, height), as a matrix on (F, M)."""
    matrix = np.eye(6)
    matrix[3, 1], matrix[4, 0] = height, -height
    return matrix
