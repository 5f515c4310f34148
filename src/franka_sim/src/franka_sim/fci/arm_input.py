"""Everything that an emulated arm is constructed from: parameters and description."""

import argparse
import ipaddress
from dataclasses import dataclass

from franka_sim.fci.robots import MAX_LOST_PACKETS, ROBOTS, RobotKind
from franka_sim.realism import Realism, parse
from franka_sim.settings import BoxSettings, SimulatedArmSettings, joint_names, read
from hric_control.limits import check_start
from hric_control.robot_settings import COMMON_PARAMETERS, RobotSettings
from hric_control.sim.simulated_robot import PlantInput
from hric_core.local.node import LocalNode
from hric_core.node import Node
from hric_core.parameters import choice, known_names, refuse_unknown, text


@dataclass(frozen=True)
class EmulatedArmSettings(BoxSettings):
    """Parameters of an emulated arm: those of the simulated arm's plant and control box, and the network's."""

    ip: str = text(
        "127.0.0.1",
        valid="an IPv4 address of this machine, e.g. 127.0.0.2,",
        made=lambda address: str(ipaddress.IPv4Address(address)),
        text="address of the control box, which uses libfranka's ports",
    )
    robot: str = choice("panda", "fr3", text="type of the arm; both use the description of the Panda")


PARAMETERS = (EmulatedArmSettings, SimulatedArmSettings, RobotSettings, *COMMON_PARAMETERS)
"""Valid parameters: an emulated arm ignores those of the simulated arm, as one experiment serves both."""


@dataclass(frozen=True)
class EmulatedArmInput:
    """Everything that an emulated arm is constructed from.

    Attributes:
        settings: parameters of plant and box.
        realism: sensor noise, and differences between the arm and the box's model of it.
        robot: kind of arm.
        urdf_xml: robot description.
        node: private namespace of the robot.
        ip: address of its control box.
        max_lost_packets: number of consecutive lost packets that ends a motion; None: no limit.
    """

    settings: BoxSettings
    realism: Realism
    robot: RobotKind
    urdf_xml: str
    node: Node
    ip: str
    max_lost_packets: int | None = MAX_LOST_PACKETS

    def plant_input(self) -> PlantInput:
        """Return description, joints and parameters for the plant of this arm, as `FrankaHWSim.plant_input` does."""
        arm_id = self.settings.arm_id
        config = self.realism.with_friction(self.settings.plant, arm_id)
        return PlantInput(self.realism.body(self.urdf_xml, arm_id), joint_names(arm_id), config)


def read_arm(node: Node, max_lost_packets: int | None = MAX_LOST_PACKETS) -> EmulatedArmInput:
    """Read the parameters of an emulated arm.

    Args:
        node: private namespace of the robot; the description is in it or above it.
        max_lost_packets: number of consecutive lost packets that ends a motion; None: no limit.

    Raises:
        HricError: a parameter is unknown or invalid, or the description cannot be used.
    """
    refuse_unknown(node.param(node.namespace, {}), known_names(PARAMETERS), node.namespace)
    settings, realism = read(node, EmulatedArmSettings)
    robot = ROBOTS[settings.robot]
    urdf_xml = robot.limited(node.search_param("robot_description"), settings.arm_id)
    check_start(urdf_xml, joint_names(settings.arm_id), settings.q_start, node.resolve("q_start"))
    return EmulatedArmInput(settings, realism, robot, urdf_xml, node, settings.ip, max_lost_packets)


def input_of_arguments(options: argparse.Namespace, robot: RobotKind) -> EmulatedArmInput:
    """Return the input of an emulated arm from the arguments of the command line. Raises HricError."""
    plant_config = {name: getattr(options, name) for name in ("world", "gui", "friction") if getattr(options, name)}
    plant_config["seed"] = options.seed
    if options.rotor_inertia is not None:
        plant_config["rotor_inertia"] = options.rotor_inertia
    if options.no_collision:
        plant_config |= {"collision": False, "self_collision": False}
    settings = BoxSettings(
        arm_id=robot.arm_id,
        plant_type=options.plant,
        plant=plant_config,
        realism=options.realism,
        q_start=tuple(options.q_start),
        reflexes=not options.no_reflexes,
        where="--",
    )
    urdf_xml = robot.description(not options.no_hand, options.vacuum, not options.no_collision)
    realism = parse(options.realism, "--realism")
    max_lost_packets = options.max_lost_packets or None
    return EmulatedArmInput(settings, realism, robot, urdf_xml, LocalNode({}), options.ip, max_lost_packets)
