"""Description of an experiment's robot, and what follows from it: joints, base link, parameters of its controllers."""

from collections.abc import Mapping, Sequence

import panda_description
from hric_control.sim.combined_hw_sim import MODEL
from hric_control.transmission import parse_transmissions
from hric_core.errors import DescriptionError, HricError, check_known, message_about
from hric_core.urdf import read
from hric_core.urdf.combining import combined
from hric_run.definition.experiment import Experiment, RobotSpec


def description(spec: RobotSpec) -> str:
    """Return the URDF of an experiment's robot, expanded from xacro: the Panda, or the robot in the file `robot.urdf`.

    Raises:
        HricError: an argument for the Panda's description is unknown, or the file is not usable.
    """
    if spec.urdf:
        return panda_description.load_file(spec.urdf)
    valid = [name for name in panda_description.arguments() if name not in ("arm_id", "robot_sim_type")]
    check_known("key", spec.description, valid, "robot.description")
    return str(panda_description.load(arm_id=spec.arm_id, robot_sim_type=spec.hw, **spec.description))


def of_experiment(definition: Experiment) -> str:
    """Return the `robot_description` of an experiment's robot; of several arms, one that has all of them.

    Raises:
        HricError: a description is not usable, or two arms have a link or joint of the same name.
    """
    if not definition.arms:
        return description(definition.robot)
    described = {}
    for name, part in definition.each_arm().items():
        try:
            described[name] = description(part.robot)
        except HricError as error:
            raise DescriptionError(message_about(f"arms.{name}", error)) from error
    return combined(MODEL, described)


def _arm_joints(arm_id: str) -> list[str]:
    """Return the joint names of a Franka arm, as in controllers.yaml."""
    return [f"{arm_id}_joint{number}" for number in range(1, 8)]


def actuated_joints(spec: RobotSpec) -> list[str]:
    """Return the names of the joints that controllers can command, in the order of the description.

    These are the joints with a transmission; if the seven joints of a Franka arm are among them, only these.

    Raises:
        HricError: the robot's description is not usable.
    """
    arm = _arm_joints(spec.arm_id)
    if not spec.urdf:
        return arm
    joints = [transmission.joint for transmission in parse_transmissions(description(spec))]
    return arm if set(arm) <= set(joints) else joints


def base_link(spec: RobotSpec) -> str:
    """Return the name of the parent link of the robot's first joint, whose frame is the robot's base frame."""
    if not spec.urdf:
        return f"{spec.arm_id}_link0"
    return read(description(spec)).joints[actuated_joints(spec)[0]].parent


def all_joints(definition: Experiment) -> list[str]:
    """Return the joints that controllers can command, of all arms."""
    parts = definition.each_arm() or {"": definition}
    return [joint for part in parts.values() for joint in actuated_joints(part.robot)]


def with_joints(controllers: Mapping[str, Mapping[str, object]], spec: RobotSpec) -> dict[str, dict[str, object]]:
    """Return the parameters of controllers, written for a Franka arm, converted to the robot of an experiment.

    For another robot, its joint names replace those of the arm, and values for each joint of the arm are removed.

    Args:
        controllers: parameters by name of the controller.
        spec: the robot.
    """
    arm, joints = _arm_joints(spec.arm_id), actuated_joints(spec)
    if joints == arm:
        return {name: dict(values) for name, values in controllers.items()}
    return {name: _of_other_robot(values, arm, joints) for name, values in controllers.items()}


def _of_other_robot(values: Mapping[str, object], arm: Sequence[str], joints: Sequence[str]) -> dict[str, object]:
    result: dict[str, object] = {}
    for key, value in values.items():
        if key in arm:
            continue
        changed = list(joints) if value == arm else value
        result[key] = _of_other_robot(value, arm, joints) if isinstance(value, Mapping) else changed
    return result
