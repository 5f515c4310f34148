"""The generator for a mode."""

from __future__ import annotations

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import FrankaLimits
from franka_sim.box.motion.cartesian import CartesianPositionGenerator, CartesianVelocityGenerator
from franka_sim.box.motion.generator import MotionGenerator
from franka_sim.box.motion.joint import JointPositionGenerator, JointVelocityGenerator
from franka_sim.box.motion_parameters import motion_parameters
from franka_sim.box.requests import GeneratorMode
from hric_control.errors import UnknownNameError


def make_generator(kind: GeneratorMode, model: KdlFrankaModel, limits: FrankaLimits, time_step: float = 0.001) -> MotionGenerator:
    """A generator; one serves any number of motions, one after the other.

    Args:
        kind: one of the four modes that generate a motion.
        model: of the arm; Cartesian generators follow its end effector, the others need its joints' names.
        limits: nominal limits of the arm, without libfranka's margins.
        time_step: [s].

    Raises:
        UnknownNameError: the mode generates no motion.
    """
    parameters = motion_parameters()
    if kind is GeneratorMode.JOINT_POSITION:
        return JointPositionGenerator(limits, model.joint_names, parameters, time_step)
    if kind is GeneratorMode.JOINT_VELOCITY:
        return JointVelocityGenerator(limits, model.joint_names, parameters, time_step)
    if kind is GeneratorMode.CARTESIAN_POSITION:
        return CartesianPositionGenerator(model, limits, parameters, time_step)
    if kind is GeneratorMode.CARTESIAN_VELOCITY:
        return CartesianVelocityGenerator(model, limits, parameters, time_step)
    valid = [mode.name for mode in GeneratorMode if mode not in (GeneratorMode.IDLE, GeneratorMode.NONE)]
    raise UnknownNameError("motion generator", kind.name, valid, "make_generator")
