"""Construction of the emulated arm from parameters or arguments."""

import argparse
from contextlib import ExitStack
from dataclasses import replace

from franka_sim import sensors
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.control_box import ControlBox
from franka_sim.fci.arm_device import ArmDevice, mounted_tool
from franka_sim.fci.clock import PERIOD
from franka_sim.fci.complaints import LOG
from franka_sim.fci.robots import MAX_LOST_PACKETS, RobotKind
from franka_sim.model_library import library_for
from franka_sim.realism import Realism, parse
from franka_sim.settings import BoxSettings, make_model, rotors_of, set_internal_impedance
from hric_control.sim.participants import Participants
from hric_core import plugins
from hric_core.errors import ParameterError
from hric_core.local.node import LocalNode
from hric_core.node import Node


def build_arm(
    settings: BoxSettings,
    realism: Realism,
    robot: RobotKind,
    urdf_xml: str,
    node: Node,
    max_lost_packets: int | None = MAX_LOST_PACKETS,
) -> ArmDevice:
    """Build the emulated arm: plant, participants, control box, and the tool of the robot description.

    Args:
        settings: parameters of plant and box.
        realism: sensor noise, and differences between the arm and the box's model of it.
        robot: kind of arm.
        urdf_xml: robot description.
        node: private namespace of the robot node, where the plant's participants read their parameters.
        max_lost_packets: number of consecutive lost packets that ends a motion; None: no limit.

    Raises:
        HricError: a parameter, a name or the description cannot be used.
    """
    arm_id = settings.arm_id
    plant_config = realism.with_friction(settings.plant, arm_id)
    model = make_model(node, urdf_xml, arm_id, plant_config)
    names = model.joint_names
    with ExitStack() as held:
        plant = plugins.find(plugins.PLANT, settings.plant_type)(realism.body(urdf_xml, arm_id), names, plant_config)
        held.callback(plant.close)
        if plant.time_step != PERIOD:
            raise ParameterError(f"{node.resolve('plant/time_step')} is {plant.time_step}; valid: {PERIOD} [s]")
        config = settings.box(plant_config, rotors_of(urdf_xml, names, plant_config), PERIOD, realism)
        config = replace(config, limits=robot.limits(), max_lost_packets=max_lost_packets)
        compiled = CompiledArm(urdf_xml, arm_id, config.min_singular_value, list(robot.accelerometers().values()))
        box = ControlBox(model, compiled, config, lambda text: LOG.warning("%s", text))
        set_internal_impedance(node, settings.internal_impedance.stiffness, box.joint_impedance)
        read_state = sensors.attach(plant, box, realism, plant_config.get("seed", 0))
        participants = Participants(plant, node)
        held.callback(participants.close)
        library = library_for(urdf_xml, arm_id)
        hand = mounted_tool(urdf_xml, arm_id, plant)
        arm = ArmDevice(plant, participants, box, robot.served_urdf, library, settings.q_start, hand, read_state)
        held.pop_all()
    return arm


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
    urdf_xml = robot.description(not options.no_hand, options.vacuum, not options.no_collision)
    realism = parse(options.realism, "--realism")
    return build_arm(settings, realism, robot, urdf_xml, LocalNode({}), options.max_lost_packets or None)
