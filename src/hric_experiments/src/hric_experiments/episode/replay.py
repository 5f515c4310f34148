"""Section `replay` of an experiment file: joint positions from a file, which a trajectory controller follows."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from controller_manager_msgs.srv import ListControllersRequest
from hric_core.errors import HricError, UnknownNameError
from hric_core.parameters import number, text
from hric_core.robot_time.stamps import to_duration
from hric_run.definition.parameters import ROBOT
from hric_run.definition.sections import ExperimentSection

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
TIME = "time"
"""Name of the first column of a trajectory file."""


@dataclass(frozen=True)
class JointPositions:
    """Positions of joints over time.

    Attributes:
        joints: names of the joints.
        time: increasing times since the start of the trajectory, shape (n,) [s].
        positions: joint positions, shape (n, number of joints) [rad].
    """

    joints: tuple[str, ...]
    time: FloatArray
    positions: FloatArray

    def velocities(self) -> FloatArray:
        """Return the velocities of cubic splines through the positions, at rest at both ends, shape (n, j) [rad/s]."""
        return np.asarray(CubicSpline(self.time, self.positions, bc_type="clamped")(self.time, 1))

    def write(self, path: Path) -> None:
        """Write the positions as CSV file: a line with `time` and the joint names, then a line per time [s], [rad]."""
        rows = np.column_stack([self.time, self.positions])
        np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=",".join((TIME, *self.joints)), comments="")


def read(path: Path) -> JointPositions:
    """Read a trajectory file. Raises HricError if it cannot be read, or has no joints, gaps, or times out of order."""
    try:
        with path.open() as file:
            names = [name.strip() for name in file.readline().split(",")]
            rows = np.loadtxt(file, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise HricError(f"trajectory file {path}: {getattr(error, 'strerror', None) or error}") from error
    if names[0] != TIME or len(names) < 2 or len(set(names)) < len(names) or rows.shape[1] != len(names):
        raise HricError(f"trajectory file {path} begins with {names}; valid: time and the name of each joint, once")
    if len(rows) < 2 or rows[0, 0] != 0.0 or not np.isfinite(rows).all() or not (np.diff(rows[:, 0]) > 0.0).all():
        raise HricError(
            f"trajectory file {path} has gaps or wrong times; valid: finite values, at least two times that rise from 0"
        )
    return JointPositions(tuple(names[1:]), rows[:, 0], rows[:, 1:])


@dataclass(frozen=True)
class ReplaySection(ExperimentSection):
    """Section `replay` of an experiment file."""

    trajectory_file: str = text(
        empty=False,
        text="CSV file with the columns `time` [s], from 0, and one per joint [rad]; relative to the experiment file",
    )
    controller: str = text(
        "position_joint_trajectory_controller",
        empty=False,
        text="trajectory controller that follows the positions; of one of several arms: `ARM/CONTROLLER`",
    )
    at: float = number(0.5, minimum=0.0, unit="s", text="robot time at which the trajectory starts")

    def check(self, where: str) -> None:
        """Raise HricError if the file is not a trajectory; where: path of the section in messages."""
        read(Path(self.trajectory_file))

    def headless(self, node: Any, seed: int) -> "Replay":
        """Return the sender of the trajectory for a headless run.

        Raises:
            HricError: the experiment does not start the controller, or the file has other joints than the controller.
        """
        motion, (namespace, _, name) = read(Path(self.trajectory_file)), self.controller.rpartition("/")
        # The robot moves the parameters of its arms to their namespaces when it is constructed.
        values = node.param(f"{ROBOT}/arms/{namespace}" if namespace else node.namespace, {})
        started = {key: value for key, value in values.items() if isinstance(value, dict) and "type" in value}
        if name not in started:
            raise UnknownNameError("controller", self.controller, list(started), "replay.controller")
        joints = started[name].get("joints", ())
        if set(joints) != set(motion.joints):
            raise HricError(
                f"{self.trajectory_file} has the joints {', '.join(motion.joints)}; valid: those of {self.controller}, "
                f"{', '.join(joints)}"
            )
        return Replay(node, self.controller, motion, self.at)


class Replay:
    """Sender of a trajectory to a controller.

    Args:
        node: node of the robot's namespace.
        controller: name of the controller.
        motion: trajectory.
        at: robot time at which the trajectory is sent [s].
    """

    def __init__(self, node: Any, controller: str, motion: JointPositions, at: float) -> None:
        self._node, self._controller = node, controller
        self._command = node.advertise(f"{controller}/command", JointTrajectory)
        self._motion: JointPositions | None = motion
        self._at = at

    def advance(self, time: float) -> None:
        """Send the trajectory once `time`, the robot time [s], has reached its start.

        Raises:
            HricError: the controller is not running.
        """
        if self._motion is None or time < self._at - 1e-9:
            return
        namespace, _, name = self._controller.rpartition("/")
        manager = f"{namespace}/controller_manager".lstrip("/")
        listed = self._node.call(f"{manager}/list_controllers", ListControllersRequest()).controller
        running = [each.name for each in listed if each.state == "running"]
        if name not in running:
            raise UnknownNameError("controller", self._controller, running, "replay.controller")
        message = JointTrajectory(joint_names=list(self._motion.joints))
        columns = self._motion.time, self._motion.positions, self._motion.velocities()
        for after, q, dq in zip(*(column.tolist() for column in columns), strict=True):
            message.points.append(JointTrajectoryPoint(positions=q, velocities=dq, time_from_start=to_duration(after)))
        self._command.publish(message)
        self._motion = None
