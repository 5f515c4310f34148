"""Construction of an emulated arm in a plant."""

from dataclasses import replace

from franka_sim import sensors
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.control_box import ControlBox
from franka_sim.fci.arm_device import ArmDevice, mounted_tool
from franka_sim.fci.arm_input import EmulatedArmInput
from franka_sim.fci.clock import PERIOD
from franka_sim.fci.complaints import LOG
from franka_sim.model_library import library_for
from franka_sim.settings import make_model, rotors_of, set_internal_impedance
from hric_control.plant import Plant


def build_device(arm: EmulatedArmInput, plant: Plant) -> ArmDevice:
    """Construct the control box of an arm, with the hand or vacuum gripper of its description. Raises HricError.

    Args:
        arm: parameters and description of the arm.
        plant: plant with the joints of this arm.
    """
    needed = arm.plant_input()
    settings, realism, urdf_xml, arm_id = arm.settings, arm.realism, arm.urdf_xml, arm.settings.arm_id
    model = make_model(arm.node, urdf_xml, arm_id, needed.config)
    rotors = rotors_of(urdf_xml, needed.joint_names, needed.config)
    config = settings.box(needed.config, rotors, PERIOD, realism)
    config = replace(config, limits=arm.robot.limits(), max_lost_packets=arm.max_lost_packets)
    compiled = CompiledArm(urdf_xml, arm_id, config.min_singular_value, list(arm.robot.accelerometers().values()))
    box = ControlBox(model, compiled, config, lambda line: LOG.warning("%s", line))
    set_internal_impedance(arm.node, settings.internal_impedance.stiffness, box.joint_impedance)
    read_state = sensors.attach(plant, box, realism, needed.config.get("seed", 0))
    library, tool = library_for(urdf_xml, arm_id), mounted_tool(urdf_xml, arm_id, plant)
    return ArmDevice(plant, box, arm.robot.served_urdf, library, settings.q_start, tool, read_state)
