"""Calibration of the mocap frame's pose in the robot's base, from pairs of points."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from hric_core.errors import CommandError
from hric_core.geometry import Pose, Vector, transformed
from hric_core.kept import write_whole
from mocap_natnet.rigid_body import Fit


@dataclass
class FrameCalibration:
    """Pairs of points: positions of one body by the cameras (`seen`, z up) and by the robot (`in_base`) [m]."""

    seen: list[Vector] = field(default_factory=list)
    in_base: list[Vector] = field(default_factory=list)

    def add(self, seen: Vector, in_base: Vector) -> None:
        """Add a pair of points: position by the cameras, z up [m], and in the robot's base [m]."""
        self.seen.append(seen)
        self.in_base.append(in_base)

    def solve(self) -> tuple[Pose, float, list[float]]:
        """Return (pose of mocap frame in the base, root mean square residual [m], residual of each pair [m]).

        Raises:
            CommandError: fewer than three pairs, or all on one line.
        """
        fit = Fit(self.seen, self.in_base)
        return fit.pose, fit.rms, residuals(fit.pose, self.seen, self.in_base)


def residuals(pose: Pose, seen: Sequence[Vector], in_base: Sequence[Vector]) -> list[float]:
    """Return the distance of each point, transformed by `pose`, from its partner in the base [m]."""
    return [
        sum((a - b) ** 2 for a, b in zip(transformed(pose, point), partner, strict=True)) ** 0.5
        for point, partner in zip(seen, in_base, strict=True)
    ]


def save(path: Path, pose: Pose, base_frame: str, rms: float, pairs: int) -> None:
    """Write the calibrated pose atomically to a file, as parameters of the node `natnet_client`.

    Raises:
        CommandError: the file cannot be written.
    """
    head = f"# From {pairs} paired points; root mean square residual {1000 * rms:.2f} mm.\n"
    content = {
        "base_frame": base_frame,
        "base_from_mocap": {"xyz": list(pose.position), "xyzw": list(pose.orientation)},
    }
    try:
        write_whole(path, (head + yaml.safe_dump(content, sort_keys=False)).encode())
    except OSError as error:
        raise CommandError(f"cannot write {path}: {error.strerror or error}") from error
