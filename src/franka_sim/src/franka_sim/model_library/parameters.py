"""Kinematic and inertial parameters of the arm for its compiled dynamics (arm.h), from the URDF."""

from dataclasses import replace

import numpy as np

from franka_hw_interface.urdf_chain import SerialChain, chain_of
from hric_core.errors import DescriptionError
from hric_core.urdf import Robot, read

JOINTS = 7
_Z = np.array([0.0, 0.0, 1.0])


def arm_without_tool(robot: Robot, arm_id: str) -> Robot:
    """Return the description of the arm alone, links 1 to 7.

    It excludes everything attached to the flange link `<arm_id>_link8`, and the mass of that link.

    Raises:
        UnknownNameError: the description has no link `<arm_id>_link8`.
    """
    flange = f"{arm_id}_link8"
    robot.check_link(flange)
    tool = {joint.child for joint, _ in robot.beyond(flange)}
    links = {name: link for name, link in robot.links.items() if name not in tool}
    links[flange] = replace(links[flange], mass=None)
    return replace(
        robot, links=links, joints={name: joint for name, joint in robot.joints.items() if joint.child not in tool}
    )


def arm_chain(urdf_xml: str, arm_id: str) -> SerialChain:
    """Return joints and links 1 to 7 of the arm as a serial chain, without the tool at the flange.

    Raises:
        DescriptionError: there are not seven joints that rotate about their z axes.
    """
    chain = chain_of(arm_without_tool(read(urdf_xml), arm_id), f"{arm_id}_link0", f"{arm_id}_link8")
    if len(chain.segments) != JOINTS:
        count = len(chain.segments)
        raise DescriptionError(
            f"the robot description: {count} moving joints between {chain.root} and {chain.tip}; a Franka arm has "
            f"{JOINTS}"
        )
    for segment in chain.segments:
        if segment.kind != "revolute" or not np.allclose(segment.axis, _Z, rtol=0.0, atol=1e-12):
            raise DescriptionError(
                f"joint {segment.joint} is {segment.kind} about {segment.axis.tolist()}; the joints of a Franka arm "
                "rotate about z of their own frames"
            )
    return chain


def arm_parameters(urdf_xml: str, arm_id: str) -> bytes:
    """Return kinematics and inertias of the arm in the layout of the struct Arm in arm.h, SI units.

    187 doubles; rotations and tensors row-major.

    Raises:
        DescriptionError, UnknownNameError: the URDF has no such arm.
    """
    chain = arm_chain(urdf_xml, arm_id)
    poses, bodies = (
        [segment.T_parent_joint for segment in chain.segments],
        [segment.inertial for segment in chain.segments],
    )
    blocks = (
        [T[:3, :3] for T in poses],
        [T[:3, 3] for T in poses],
        [body.mass for body in bodies],
        [body.com for body in bodies],
        [body.inertia for body in bodies],
        chain.T_last_tip[:3, :3],
        chain.T_last_tip[:3, 3],
    )
    return b"".join(np.asarray(block, dtype=np.float64).tobytes() for block in blocks)
