"""Motion generators of the control box: check a client's commands and convert them to a desired joint motion."""

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import FrankaLimits
from franka_sim.box.config import motion_parameters
from franka_sim.box.motion.cartesian import CartesianPositionGenerator, CartesianVelocityGenerator
from franka_sim.box.motion.generator import MotionGenerator as MotionGenerator
from franka_sim.box.motion.joint import JointPositionGenerator, JointVelocityGenerator
from franka_sim.box.requests import GeneratorMode
from hric_core.errors import UnknownNameError


def make_generator(
    kind: GeneratorMode, model: KdlFrankaModel, limits: FrankaLimits, time_step: float = 0.001
) -> MotionGenerator:
    """Return a motion generator, which can serve any number of consecutive motions.

    Args:
        kind: joint or Cartesian, position or velocity mode.
        model: model of the arm; Cartesian generators use its end effector, the others its joint names.
        limits: nominal limits of the arm, without libfranka's margins.
        time_step: control period [s].

    Raises:
        UnknownNameError: the mode generates no motion.
    """
    joint = {GeneratorMode.JOINT_POSITION: JointPositionGenerator, GeneratorMode.JOINT_VELOCITY: JointVelocityGenerator}
    cartesian = {
        GeneratorMode.CARTESIAN_POSITION: CartesianPositionGenerator,
        GeneratorMode.CARTESIAN_VELOCITY: CartesianVelocityGenerator,
    }
    if kind in joint:
        return joint[kind](limits, model.joint_names, motion_parameters(), time_step)
    if kind in cartesian:
        return cartesian[kind](model, limits, motion_parameters(), time_step)
    raise UnknownNameError(
        "motion generator", kind.name, [mode.name for mode in (*joint, *cartesian)], "make_generator"
    )
