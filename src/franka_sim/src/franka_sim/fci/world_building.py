"""Construction of the world of emulated arms from parameters or arguments."""

import argparse
from collections.abc import Mapping
from contextlib import ExitStack

from franka_sim.fci.arm_building import build_device
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.arm_input import EmulatedArmInput, input_of_arguments
from franka_sim.fci.arm_world import ArmWorld
from franka_sim.fci.clock import PERIOD
from franka_sim.fci.robots import RobotKind
from franka_sim.fci.server import FciArm
from hric_control.sim.combined_hw_sim import combined_input, common
from hric_control.sim.participants import Participants
from hric_control.sim.shared_plant import SharedPlant
from hric_core import plugins
from hric_core.errors import ParameterError
from hric_core.node import Node


def build_world(arms: Mapping[str, EmulatedArmInput], node: Node) -> ArmWorld:
    """Build the world of emulated arms: plant, participants, and the control box of each arm.

    Args:
        arms: inputs of the arms by name; several arms share one plant.
        node: private namespace of the robot node, where the plant's participants read their parameters.

    Raises:
        HricError: a parameter or a description is invalid, or the arms do not fit into one plant.
    """
    needed = {name: arm.plant_input() for name, arm in arms.items()}
    plant_type = common("plant_type", {name: arm.settings.plant_type for name, arm in arms.items()})
    together = next(iter(needed.values())) if len(arms) == 1 else combined_input(needed)
    with ExitStack() as held:
        plant = plugins.find(plugins.PLANT, plant_type)(together.urdf_xml, together.joint_names, together.config)
        held.callback(plant.close)
        if plant.time_step != PERIOD:
            where = next(iter(arms.values())).node.resolve("plant/time_step")
            raise ParameterError(f"{where} is {plant.time_step}; valid: {PERIOD} [s]")
        shared = None if len(arms) == 1 else SharedPlant(plant)
        parts = [plant] if shared is None else [shared.part(part.joint_names) for part in needed.values()]
        devices = [build_device(arm, part) for arm, part in zip(arms.values(), parts, strict=True)]
        participants = Participants(plant, node)
        held.callback(participants.close)
        world = ArmWorld(plant, participants, devices, shared)
        held.pop_all()
    return world


def served_arms(arms: Mapping[str, EmulatedArmInput], world: ArmWorld) -> dict[str, FciArm]:
    """Return the arms of a world by name, with their addresses; arms: inputs from which the world was built."""
    return {
        name: FciArm(device, arm.ip, arm.robot.version)
        for (name, arm), device in zip(arms.items(), world.arms, strict=True)
    }


def make_arm(options: argparse.Namespace, robot: RobotKind) -> ArmDevice:
    """Build the emulated arm from the arguments of the command line. Raises HricError."""
    arm = input_of_arguments(options, robot)
    return build_world({robot.arm_id: arm}, arm.node).arms[0]
