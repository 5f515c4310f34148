"""Construction of emulated arms and their world from parameters or arguments."""

import argparse
import ipaddress
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from xml.etree import ElementTree

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim import sensors
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.control_box import ControlBox
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.arm_world import ArmWorld
from franka_sim.fci.clock import PERIOD
from franka_sim.fci.complaints import LOG
from franka_sim.fci.robots import MAX_LOST_PACKETS, ROBOTS, RobotKind
from franka_sim.fci.server import ServedArm
from franka_sim.model_library import library_for
from franka_sim.realism import Realism, parse
from franka_sim.settings import (
    BoxSettings,
    SimulatedArmSettings,
    joint_names,
    make_model,
    read,
    rotors_of,
    set_internal_impedance,
)
from hric_control.limits import check_start
from hric_control.plant import Plant
from hric_control.robot_settings import COMMON_PARAMETERS, RobotSettings
from hric_control.sim.combined_hw_sim import combined_input, common
from hric_control.sim.participants import Participants
from hric_control.sim.shared_plant import SharedPlant
from hric_control.sim.simulated_robot import PlantInput
from hric_core import plugins
from hric_core.errors import ParameterError
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
        text="address of the server, on libfranka's ports",
    )
    robot: str = choice("panda", "fr3", text="type of the arm; both use the description of the Panda")


PARAMETERS = (EmulatedArmSettings, SimulatedArmSettings, RobotSettings, *COMMON_PARAMETERS)
"""Valid parameters: an emulated arm ignores those of the simulated arm, as one experiment serves both."""


@dataclass(frozen=True)
class ArmInput:
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
        """Return what the arm needs of its plant, as `FrankaHWSim.plant_input`."""
        arm_id = self.settings.arm_id
        config = self.realism.with_friction(self.settings.plant, arm_id)
        return PlantInput(self.realism.body(self.urdf_xml, arm_id), joint_names(arm_id), config)

    def model(self) -> KdlFrankaModel:
        """Return the control box's model of the arm. Raises HricError if the description is not that of the arm."""
        return make_model(self.node, self.urdf_xml, self.settings.arm_id, self.settings.plant)

    def device(self, plant: Plant, needed: PlantInput, model: KdlFrankaModel) -> ArmDevice:
        """Construct the control box of the arm, and a hand if the robot description has one.

        Args:
            plant: plant with the joints of this arm.
            needed: the arm's `plant_input`.
            model: the arm's `model`.

        Raises:
            HricError: a parameter, a name or the description cannot be used.
        """
        settings, realism, urdf_xml, arm_id = self.settings, self.realism, self.urdf_xml, self.settings.arm_id
        rotors = rotors_of(urdf_xml, needed.joint_names, needed.config)
        config = settings.box(needed.config, rotors, PERIOD, realism)
        config = replace(config, limits=self.robot.limits(), max_lost_packets=self.max_lost_packets)
        compiled = CompiledArm(urdf_xml, arm_id, config.min_singular_value)
        box = ControlBox(model, compiled, config, lambda line: LOG.warning("%s", line))
        set_internal_impedance(self.node, settings.internal_impedance.stiffness, box.joint_impedance)
        read_state = sensors.attach(plant, box, realism, needed.config.get("seed", 0))
        library, hand = library_for(urdf_xml, arm_id), _has_hand(urdf_xml, arm_id)
        return ArmDevice(plant, box, self.robot.served_urdf, library, settings.q_start, hand, read_state)


def read_arm(node: Node, max_lost_packets: int | None = MAX_LOST_PACKETS) -> ArmInput:
    """Read the parameters of an emulated arm.

    Args:
        node: private namespace of the robot; the description is in it or above it.
        max_lost_packets: number of consecutive lost packets that ends a motion; None: no limit.

    Raises:
        HricError: a parameter is unknown, or it, a name or the description cannot be used.
    """
    refuse_unknown(node.param(node.namespace, {}), known_names(PARAMETERS), node.namespace)
    settings, realism = read(node, EmulatedArmSettings)
    robot = ROBOTS[settings.robot]
    urdf_xml = robot.limited(node.search_param("robot_description"), settings.arm_id)
    check_start(urdf_xml, joint_names(settings.arm_id), settings.q_start, node.resolve("q_start"))
    return ArmInput(settings, realism, robot, urdf_xml, node, settings.ip, max_lost_packets)


def build_world(arms: Mapping[str, ArmInput], node: Node) -> ArmWorld:
    """Build the world of emulated arms: plant, participants, and the control box of each arm.

    Args:
        arms: the arms by name; several stand in one plant.
        node: private namespace of the robot node, where the plant's participants read their parameters.

    Raises:
        HricError: a parameter, a name or the description cannot be used.
    """
    models = {name: arm.model() for name, arm in arms.items()}
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
        devices = [
            arm.device(plant if shared is None else shared.part(needed[name].joint_names), needed[name], models[name])
            for name, arm in arms.items()
        ]
        participants = Participants(plant, node)
        held.callback(participants.close)
        world = ArmWorld(plant, participants, devices, shared)
        held.pop_all()
    return world


def served_arms(arms: Mapping[str, ArmInput], world: ArmWorld) -> dict[str, ServedArm]:
    """Return the arms of a world with their addresses, for the server; arms: what the world was built from."""
    return {
        name: ServedArm(device, arm.ip, arm.robot.version)
        for (name, arm), device in zip(arms.items(), world.arms, strict=True)
    }


def _has_hand(urdf_xml: str, arm_id: str) -> bool:
    return any(link.get("name") == f"{arm_id}_hand" for link in ElementTree.fromstring(urdf_xml).iterfind("link"))


def make_arm(options: argparse.Namespace, robot: RobotKind) -> ArmDevice:
    """Build the emulated arm from the arguments of the command line. Raises HricError."""
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
    urdf_xml = robot.urdf(not options.no_hand, not options.no_collision)
    realism = parse(options.realism, "--realism")
    node = LocalNode({})
    arm = ArmInput(settings, realism, robot, urdf_xml, node, options.ip, options.max_lost_packets or None)
    return build_world({robot.arm_id: arm}, node).arms[0]
