"""Contract between a policy and the arm: fields, units and scales of its input and output. The ONNX file has it."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from franka_hw_interface.model import FrankaFrame, FrankaModel
from hric_controllers.cartesian.workspace import Box
from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.parameters import (
    Settings,
    choice,
    listing,
    mapping,
    names,
    number,
    numbers,
    refused,
    section,
    text,
    whole,
)

KEY = "hric_policy"
"""Key of the contract in the metadata of an ONNX file."""
VERSION = 1
"""Version of the contract; files of other versions are refused."""
FIELDS = {
    "q": (7, "rad"),
    "dq": (7, "rad/s"),
    "command": (7, "rad"),
    "ee_position": (3, "m"),
    "wrench": (6, "N, N m"),
    "goal": (3, "m"),
    "goal_offset": (3, "m"),
}
"""Number of values and unit of each field that a policy can observe: joint positions and velocities, present setpoint,
position of the end effector (O_T_EE), estimated external wrench (O_F_ext_hat_K), goal of the end effector, and goal
less position of the end effector; vectors in axes of the base."""
STREAM = "end_effector_stream"
"""Kind of action: velocity of the end effector, from which the controller computes a stream of joint setpoints."""
JOINT_SPEED = 1.0
"""Largest velocity of a joint's setpoint [rad/s]; a faster motion of all joints is slowed down (project default)."""
MARGIN = 0.05
"""Distance of setpoints from the ends of the joint ranges [rad], as the motion may overshoot (project default)."""
DAMPING = 0.01
"""Damping of the least squares, a length below which the end effector can hardly move in a direction [m]."""
POSTURE = (0.3, -0.6, 0.2, -2.1, 0.4, 1.7, 0.5)
"""Joint positions at which the end effectors of two robots are compared [rad] (project default)."""
SAME = {"lower": 1e-3, "upper": 1e-3, "ee_position": 5e-3}
"""Largest differences of two robots that count as the same, by field of `PolicyRobot` [rad], [m] (project default)."""
Vector = npt.NDArray[np.float32]


@dataclass(frozen=True)
class FieldScale(Settings):
    """Field of an observation; the policy gets (value - offset) / scale."""

    name: str = choice(*FIELDS)
    unit: str = text()
    offset: tuple[float, ...] = numbers()
    scale: tuple[float, ...] = numbers(above=0.0)

    def check(self, where: str) -> None:
        """Raise an error if unit or number of values are not those of the field."""
        count, unit = FIELDS[self.name]
        if self.unit != unit:
            raise refused(f"{where}unit", self.unit, f"{unit}, the unit of {self.name}")
        for name in ("offset", "scale"):
            if len(getattr(self, name)) != count:
                raise refused(f"{where}{name}", getattr(self, name), f"{count} numbers, as {self.name} has")


@dataclass(frozen=True)
class PolicyRobot(Settings):
    """Robot on which a policy was trained; observations and actions have the same meaning on a robot like it.

    The pose of the base does not count, because goals, positions and velocities are given in the frame of the base.
    """

    arm_id: str = text(empty=False)
    joints: tuple[str, ...] = names(7, text="names of the joints without `<arm_id>_`, in the order of their values")
    lower: tuple[float, ...] = numbers(7, unit="rad")
    upper: tuple[float, ...] = numbers(7, unit="rad")
    ee_position: tuple[float, ...] = numbers(3, unit="m", text="position of the end effector at POSTURE")

    @classmethod
    def of_arm(
        cls, arm_id: str, joints: Sequence[str], ranges: Sequence[tuple[float, float]], model: FrankaModel
    ) -> Self:
        """Return the description of an arm by the names and ranges [rad] of its joints and by its model."""
        lower, upper = zip(*ranges, strict=True)
        ee_position = model.pose(FrankaFrame.END_EFFECTOR, POSTURE)[:3, 3].tolist()
        return cls(arm_id, tuple(joint.removeprefix(f"{arm_id}_") for joint in joints), lower, upper, ee_position)

    def different(self, other: "PolicyRobot") -> list[str]:
        """Return the names of the fields in which another robot differs; the name of the arm does not count."""
        names = [] if self.joints == other.joints else ["joints"]
        return names + [
            name
            for name, tolerance in SAME.items()
            if not np.allclose(getattr(self, name), getattr(other, name), rtol=0.0, atol=tolerance)
        ]


def _shown(robot: PolicyRobot, name: str) -> str:
    """Return the values of a field as text."""
    return ", ".join(value if isinstance(value, str) else f"{value:.4g}" for value in getattr(robot, name))


@dataclass(frozen=True)
class PolicyContract(Settings):
    """Contract of a policy, read from the metadata of its ONNX file."""

    version: int = whole(minimum=VERSION, maximum=VERSION)
    fields: tuple[FieldScale, ...] = listing(section(FieldScale), range(1, len(FIELDS) + 1))
    period: float = number(minimum=0.005, maximum=0.5, unit="s", text="time between two actions")
    action: str = choice(STREAM)
    action_scale: float = number(above=0.0, maximum=2.0, unit="m/s", text="velocity along an axis of the base for 1")
    near: float = number(above=0.0, unit="m", text="distance from the goal at which the policy has finished")
    robot: PolicyRobot | None = section(PolicyRobot, None, text="robot of the training; none: not known")
    goals: Box | None = section(Box, None, text="box of the goals in the training; none: not known")
    training: Mapping[str, object] = mapping(default={}, text="task, seed and steps of the training, for readers")

    def check(self, where: str) -> None:
        """Raise an error if a field occurs twice."""
        names = [field.name for field in self.fields]
        if len(set(names)) < len(names):
            raise refused(f"{where}fields", names, "each field once")
        offset, scale = ([x for field in self.fields for x in getattr(field, key)] for key in ("offset", "scale"))
        object.__setattr__(self, "_scaling", (np.array(offset), np.array(scale)))

    def check_robot(self, arm: PolicyRobot, ignored: Collection[str] = ()) -> Box:
        """Return the box of the goals. Raises ParameterError if the policy was trained on another or an unknown robot.

        Args:
            arm: the robot.
            ignored: names of fields of PolicyRobot that may differ.
        """
        if self.robot is None or self.goals is None:
            raise ParameterError(
                "the robot of the policy is not known: its file has no robot and goals, as those written by older "
                "versions; valid: the file of a new training by hric train"
            )
        for name in self.robot.different(arm):
            if name not in ignored:
                ranges = ", or other_ranges: true of the controller" if name in ("lower", "upper") else ""
                raise ParameterError(
                    f"the policy is of another robot: {name} of {self.robot.arm_id} in the training: "
                    f"{_shown(self.robot, name)}, of {arm.arm_id}: {_shown(arm, name)}; valid: a policy of this robot"
                    f"{ranges}"
                )
        return self.goals

    @property
    def size(self) -> int:
        """Number of values of an observation."""
        return sum(FIELDS[field.name][0] for field in self.fields)

    def observation(self, values: Mapping[str, Sequence[float]]) -> Vector:
        """Return the observation, shape (size,); `values`: values by field, except `goal_offset`."""
        offset, scale = self._scaling  # type: ignore[attr-defined]  # set by check, as the class is frozen
        values = {**values, "goal_offset": np.subtract(values["goal"], values["ee_position"]).tolist()}
        joined = np.concatenate([values[field.name] for field in self.fields])
        result: Vector = ((joined - offset) / scale).astype(np.float32)
        return result

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str], path: str) -> Self:
        """Return the contract in the metadata of the file `path`. Raises ParameterError if there is no valid one."""
        if KEY not in metadata:
            raise ParameterError(
                f"{path} does not say what its policy observes: its metadata has no {KEY}; valid: a file by hric train"
            )
        try:
            content = json.loads(metadata[KEY])
        except json.JSONDecodeError as error:
            raise ParameterError(f"{path}: {KEY} is not JSON: {error}; valid: a file by hric train") from None
        return cls.of(content, f"{path}: {KEY}")

    def text(self) -> str:
        """Return the contract as the JSON of the metadata."""
        return json.dumps(asdict(self), sort_keys=True)


def moved(model: FrankaModel, q: FloatArray, displacement: FloatArray, period: float) -> FloatArray:
    """Return the joint positions [rad] after a displacement of the end effector, by damped least squares.

    Source: Nakamura and Hanafusa, J. Dyn. Sys. Meas. Control 108:163, 1986.

    Args:
        model: model of the arm.
        q: joint positions before, shape (7,) [rad].
        displacement: displacement of the end effector in axes of the base, shape (3,) [m].
        period: time for the displacement [s].
    """
    J = model.zero_jacobian(FrankaFrame.END_EFFECTOR, q.tolist())[:3]
    step = J.T @ np.linalg.solve(J @ J.T + DAMPING**2 * np.eye(3), displacement)
    return q + step / max(1.0, float(np.abs(step).max()) / (JOINT_SPEED * period))


def within(q: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Return `q`, shape (7,) [rad], clipped to the joint ranges `lower` to `upper` less MARGIN at each end."""
    return np.clip(q, lower + MARGIN, upper - MARGIN)
