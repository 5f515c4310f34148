"""Which motion of the control box carries which mode of the controllers; as libfranka's control loops ask for it."""

from __future__ import annotations

from franka_hw_interface.modes import Kind, Mode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest

_GENERATORS = {
    None: GeneratorMode.NONE,
    Kind.POSITION: GeneratorMode.JOINT_POSITION,
    Kind.VELOCITY: GeneratorMode.JOINT_VELOCITY,
    Kind.POSE: GeneratorMode.CARTESIAN_POSITION,
    Kind.TWIST: GeneratorMode.CARTESIAN_VELOCITY,
}


def move_request(mode: Mode) -> MoveRequest:
    """Torques from outside, or the internal joint impedance behind a motion generator, or a generator beside torques from outside."""
    controller = ControllerMode.EXTERNAL if mode.torque else ControllerMode.JOINT_IMPEDANCE
    return MoveRequest(controller, _GENERATORS[mode.generator])
