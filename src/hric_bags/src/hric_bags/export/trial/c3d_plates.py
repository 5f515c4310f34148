"""Force plates in the conventions of c3d files: corners, origin, signals and calibration."""

from dataclasses import dataclass, replace

import numpy as np

from hric_bags.export.frames import FixedFrames
from hric_bags.export.table import FloatArray, TopicTable
from hric_bags.run_file import RunFile
from hric_perception.plate.geometry import PLATE_SIZE

FLIP = np.diag([1.0, -1.0, -1.0])
"""Rotation between the axes of a plate (z up) and those of a plate in c3d files (z down); its own inverse."""
QUADRANTS = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
"""Signs of the corners' coordinates in the axes of a c3d plate (c3d.org, FORCE_PLATFORM:CORNERS)."""
N_MM = np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])
"""Factors by which a wrench is converted from N and N m to N and N mm."""


@dataclass(frozen=True)
class PlateSettings:
    """Settings of a force plate in a run, from the section `force_plate` of its experiment file.

    Attributes:
        size: size of the surface along x and y [m].
        height: height of the surface above the origin of the moments [m].
        invert: True if the device measures the reaction, not the load.
        calibration: (Fx .. Mz) = calibration @ signals, shape (6, 6) [N/V, N m/V]; None: the device sends forces.
    """

    size: tuple[float, float] = PLATE_SIZE
    height: float = 0.0
    invert: bool = False
    calibration: FloatArray | None = None

    def over(self, surface: float) -> "PlateSettings":
        """Return the settings with the height `surface` [m]; 0: unchanged settings."""
        return replace(self, height=surface) if surface else self


@dataclass(frozen=True)
class C3dPlate:
    """Force plate in a c3d file.

    Attributes:
        name: name of the plate.
        kind: type of the plate in c3d, 2 or 4.
        corners: corners of the surface in OpenSim's ground, shape (4, 3) [m].
        origin: vector from the origin of the moments to the middle of the surface, in the file's axes of the plate,
            shape (3,) [m].
        calibration: calibration matrix, shape (6, 6) [N/V, N mm/V]; the identity for type 2.
        units: units of the six channels.
        axes: text on how the pose was determined.
    """

    name: str
    kind: int
    corners: FloatArray
    origin: FloatArray
    calibration: FloatArray
    units: tuple[str, ...]
    axes: str


def plate_settings(run: RunFile) -> dict[str, PlateSettings]:
    """Return the settings of the force plates in run.yaml, by name of the plate."""
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


def plate_of(
    table: TopicTable, frames: FixedFrames, settings: PlateSettings, wrench: FloatArray
) -> tuple[C3dPlate, FloatArray]:
    """Return a force plate and its signals, shape (n, 6), as a c3d file needs them.

    A c3d file holds the load of the plate on the body, in axes with z down: BTK, OpenSim and ezc3d read its channels
    this way, without a change of sign.

    Args:
        table: samples of the plate.
        frames: frames of the run; the plate's frame is at the middle of the surface, z up.
        settings: settings of the plate.
        wrench: samples as the device sends them, shape (n, 6) [N, N m].
    """
    from hric_bags.export.opensim_formats import plate_name

    T, axes = frames.in_ground(table.frame)
    R_ground_file = T[:3, :3] @ FLIP
    half = np.array([*settings.size, 0.0]) / 2
    corners = T[:3, 3] + (QUADRANTS * half) @ R_ground_file.T
    to_file = np.kron(np.eye(2), (1.0 if settings.invert else -1.0) * FLIP) * N_MM[:, None]
    if settings.height < 0:
        # Readers take an origin above the surface for a sign error, so the moments are moved to the surface.
        to_file = to_file @ _at_surface(settings.height)
    origin = np.array([0.0, 0.0, -max(settings.height, 0.0)])
    if settings.calibration is None:
        plate = C3dPlate(plate_name(table), 2, corners, origin, np.eye(6), ("N",) * 3 + ("Nmm",) * 3, axes)
        return plate, np.asarray(wrench @ to_file.T)
    signals = np.asarray(np.linalg.solve(settings.calibration, wrench.T).T, dtype=float)
    return C3dPlate(plate_name(table), 4, corners, origin, to_file @ settings.calibration, ("V",) * 6, axes), signals


def _at_surface(height: float) -> FloatArray:
    """Return the matrix that maps (F, M) to (F, M + F x p) with p = (0, 0, height)."""
    matrix = np.eye(6)
    matrix[3, 1], matrix[4, 0] = height, -height
    return matrix
