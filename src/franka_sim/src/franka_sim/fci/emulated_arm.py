"""The emulated arm made of the command's arguments: description, plant, control box, hand."""

from __future__ import annotations

import argparse
from typing import Any

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.compiled_arm import compiled_arm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.complaints import LOG
from franka_sim.fci.robots import Robot
from franka_sim.gripper import Gripper
from franka_sim.model_library import library_for
from franka_sim.realism import parse
from franka_sim.sensors import attach
from hric_control import plugins


def make_arm(options: argparse.Namespace, robot: Robot) -> ArmDevice:
    """Plant, box and hand. Raises HricError."""
    arm_id = robot.arm_id
    urdf_xml = robot.urdf(not options.no_hand, not options.no_collision)
    realism = parse(options.realism, "--realism")
    plant_config: dict[str, Any] = {"rotor_inertia": options.rotor_inertia}
    for key, value, usual in (("world", options.world, ""), ("gui", options.gui, False), ("friction", options.friction, None)):
        if value != usual:
            plant_config[key] = value
    if options.no_collision:
        plant_config |= {"collision": False, "self_collision": False}
    plant_config = realism.with_friction(plant_config, arm_id)
    model = KdlFrankaModel(urdf_xml, arm_id)
    config = BoxConfig(
        limits=robot.limits(),
        friction=realism.known_friction(plant_config, model.joint_names),
        rotor_inertia=(options.rotor_inertia,) * 7,
        reflexes=not options.no_reflexes,
        max_lost_packets=options.max_lost_packets or None,
    )
    compiled = compiled_arm(urdf_xml, arm_id, config.least_singular_value, LOG.info)
    box = ControlBox(model, config, lambda text: LOG.warning("%s", text), compiled)
    plant = plugins.find(plugins.PLANT, options.plant)(realism.body(urdf_xml, arm_id), model.joint_names, plant_config)
    hand = None if options.no_hand else Gripper()
    fields = None if compiled is None else compiled.fields
    read_state = attach(plant, box, realism, options.seed)
    return ArmDevice(plant, box, robot.served_urdf, lambda: _library(robot), options.q_start, hand, fields, read_state)


def _library(robot: Robot) -> bytes:
    return library_for(robot.urdf(False, False), robot.arm_id)
