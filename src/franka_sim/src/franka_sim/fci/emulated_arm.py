"""The emulated arm made of the command's arguments: description, plant, control box, hand."""

from __future__ import annotations

import argparse
from typing import Any

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.compiled_arm import compiled_arm
from franka_sim.box.config import BoxConfig
from franka_sim.box.control_box import ControlBox
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.complaints import LOG
from franka_sim.fci.robots import Robot
from franka_sim.gripper import Gripper
from franka_sim.model_library import library_for
from hric_control import plugins


def make_arm(options: argparse.Namespace, robot: Robot) -> ArmDevice:
    """Plant, box and hand. Raises HricError."""
    arm_id = robot.arm_id
    urdf_xml = robot.urdf(not options.no_hand, not options.no_collision)
    plant_config: dict[str, Any] = {"rotor_inertia": options.rotor_inertia, "friction": options.friction}
    friction = None
    if options.friction == "identified":
        friction = plant_config["friction_parameters"] = panda_description.friction_parameters(arm_id)
    for key, value, usual in (("world", options.world, ""), ("gui", options.gui, False)):
        if value != usual:
            plant_config[key] = value
    if options.no_collision:
        plant_config |= {"collision": False, "self_collision": False}
    model = KdlFrankaModel(urdf_xml, arm_id)
    config = BoxConfig(
        limits=robot.limits(),
        friction=friction,
        rotor_inertia=(options.rotor_inertia,) * 7,
        reflexes=not options.no_reflexes,
        max_lost_packets=options.max_lost_packets or None,
    )
    compiled = compiled_arm(urdf_xml, arm_id, config.least_singular_value, LOG.info)
    box = ControlBox(model, config, lambda text: LOG.warning("%s", text), compiled)
    plant = plugins.find(plugins.PLANT, options.plant)(urdf_xml, model.joint_names, plant_config)
    hand = None if options.no_hand else Gripper()
    return ArmDevice(plant, box, robot.served_urdf, lambda: _library(robot), options.q_start, hand, None if compiled is None else compiled.fields)


def _library(robot: Robot) -> bytes:
    return library_for(robot.urdf(False, False), robot.arm_id)
