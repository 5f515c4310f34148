"""Gravity torque and mass matrix of a controller's joints: from the robot's own model if it offers one, else by KDL from robot_description."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from franka_hw_interface.interfaces import FrankaModelInterface
from franka_hw_interface.kdl_chain import KdlChain
from hric_control import urdf
from hric_control.errors import DescriptionError, HricError
from hric_control.hardware_interface import JointStateInterface
from hric_control.node import Node
from hric_control.robot_hw import RobotHW
from hric_controllers.parameters import flag
from hric_controllers.pd_law import Gravity

FloatArray = npt.NDArray[np.float64]


class ChainDynamics:
    """A KDL chain of the description; joints of the chain that the controller does not have count with their measured positions.

    One instance for one thread.
    """

    def __init__(self, chain: KdlChain, robot_hw: RobotHW, joints: Sequence[str]) -> None:
        self._chain = chain
        self._states = robot_hw.get(JointStateInterface).group(chain.joint_names)
        self._order = [chain.joint_names.index(joint) for joint in joints]
        self.gravity: Gravity = chain.gravity_list if list(joints) == list(chain.joint_names) else self._reordered
        """Gravity torque, n floats [N m]; q: n floats [rad]."""

    def _reordered(self, q: list[float]) -> list[float]:
        torque = self._chain.gravity_list(self._states.positions())
        return [torque[i] for i in self._order]

    def mass(self) -> FloatArray:
        """Mass matrix at the present position, shape (n, n) [kg m^2]."""
        full: FloatArray = self._chain.mass(self._states.positions())
        return full[np.ix_(self._order, self._order)]


def wanted_gravity(robot_hw: RobotHW, root_node: Node, node: Node, joints: Sequence[str]) -> Gravity | None:
    """The gravity torque that a controller with the parameter `gravity` adds; None if it does not.

    Raises:
        HricError: wanted, but the arm adds it itself; or where it should come from is missing.
    """
    if not flag(node, "gravity", False):
        return None
    if robot_hw.compensates_gravity:
        raise HricError(
            f"{node.resolve('gravity')} is true, but both the arm {type(robot_hw).__name__} and the controller "
            f"{node.namespace.rsplit('/', 1)[-1]} would add g(q); valid with this arm: gravity: false"
        )
    gravity, source = gravity_source(robot_hw, root_node, joints)
    node.log_info(f"adds g(q) from {source}")
    return gravity


def gravity_source(robot_hw: RobotHW, root_node: Node, joints: Sequence[str]) -> tuple[Gravity, str]:
    """Gravity torque of these joints, to be called in the loop, and where it comes from, for the user.

    The robot's model interface goes first: it knows the end effector and the load that the robot was told of.

    Raises:
        HricError: neither a model interface for them nor a description with one serial chain through them.
    """
    if robot_hw.has(FrankaModelInterface):
        interface = robot_hw.get(FrankaModelInterface)
        for name in interface.names:
            arm = [f"{name.removesuffix('_model')}_joint{i}" for i in range(1, 8)]
            if set(joints) <= set(arm):
                return _model_gravity(interface.handle(name), [arm.index(joint) for joint in joints]), "the robot's model interface"
    return chain_dynamics(robot_hw, root_node, joints).gravity, "robot_description, by KDL"


def _model_gravity(model: Any, order: list[int]) -> Gravity:
    whole = order == list(range(7))

    def gravity(q: list[float]) -> list[float]:
        torque: list[float] = model.gravity().tolist()  # at the robot's present position, which is q
        return torque if whole else [torque[i] for i in order]

    return gravity


def chain_dynamics(robot_hw: RobotHW, root_node: Node, joints: Sequence[str]) -> ChainDynamics:
    """A private KDL chain through the joints.

    Raises:
        HricError: no description, or no serial chain through all joints in it.
    """
    return ChainDynamics(_chain(root_node.search_param("robot_description"), joints), robot_hw, joints)


def _chain(urdf_xml: str, joints: Sequence[str]) -> KdlChain:
    """The chain from the root link of the description to the outermost of the joints."""
    root = urdf.parse(urdf_xml)
    elements, start = urdf.joints(root), urdf.root_link(root)
    problem = f"no joint of {', '.join(joints)} is in robot_description"
    for joint in reversed(joints):
        child = elements[joint].find("child") if joint in elements else None
        if child is None:
            continue
        chain = KdlChain(urdf_xml, start, child.get("link", ""))
        missing = [name for name in joints if name not in chain.joint_names]
        if not missing:
            return chain
        problem = f"{', '.join(missing)} not on the chain from {start} to {child.get('link')} ({', '.join(chain.joint_names)})"
    raise DescriptionError(f"dynamics need one serial chain through all joints: {problem}")
