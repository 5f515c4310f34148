"""State and model of the arm that a Cartesian controller moves: of a Franka arm, or by KDL of any other serial arm.

For other arms, `ChainArm` has those members of Franka's state and model handles that the controllers read.
"""

from typing import Any

from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.kdl_chain import KdlChain
from franka_hw_interface.model import FrankaFrame
from franka_hw_interface.urdf_chain import parse_chain
from hric_control.hardware_interface import JointGroup
from hric_control.robot_hw import RobotHW
from hric_core.errors import HricError, ParameterError
from hric_core.geometry import FloatArray
from hric_core.node import Node
from hric_core.urdf import read


class ChainArm:
    """State and dynamic model of a serial arm at its measured position.

    Args:
        chain: chain from the base to the end effector.
        group: joints of the chain, in its order.
    """

    def __init__(self, chain: KdlChain, group: JointGroup) -> None:
        self._chain, self._group = chain, group

    @property
    def q(self) -> list[float]:
        """Joint positions, n floats [rad]."""
        return self._group.positions()

    @property
    def dq(self) -> list[float]:
        """Joint velocities, n floats [rad/s]."""
        return self._group.velocities()

    @property
    def O_T_EE(self) -> list[float]:
        """Pose of the end effector in the base frame, a 4 x 4 matrix as 16 floats, column-major [m]."""
        return [float(value) for value in self._chain.pose(self.q).T.ravel()]

    def mass(self) -> FloatArray:
        """Return the mass matrix, shape (n, n) [kg m^2]."""
        return self._chain.mass(self.q)

    def coriolis(self) -> FloatArray:
        """Return the Coriolis torque C dq, shape (n,) [N m]."""
        return self._chain.coriolis(self.q, self.dq)

    def zero_jacobian(self, frame: FrankaFrame) -> FloatArray:
        """Return the end effector's Jacobian in base axes, linear above angular, shape (6, n); `frame` is ignored."""
        return self._chain.jacobian(self.q)


def cartesian_arm(
    robot_hw: RobotHW, root_node: Node, group: JointGroup, arm_id: str, end_effector: str, where: str
) -> tuple[Any, Any, str]:
    """Return the state and the model of an arm, and the name of its base frame.

    Args:
        robot_hw: the robot.
        root_node: node in or above whose namespace the parameter robot_description is.
        group: joints of the arm, from the base on.
        arm_id: name of the Franka arm; not used for another arm.
        end_effector: link that the controller moves; empty for a Franka arm, which has its own.
        where: full name of the parameter `end_effector`, for errors.

    Raises:
        HricError: `end_effector` is set for a Franka arm, or empty for another arm, or the link is moved by other
            joints than those of `group`.
    """
    franka = robot_hw.has(FrankaModelInterface)
    if franka == bool(end_effector):
        problem = "is set, but" if franka else "is not set, and"
        valid = "empty, for the arm's own end effector" if franka else "the link that the controller moves, e.g. tool0"
        raise ParameterError(
            f"{where} {problem} {type(robot_hw).__name__} is {'a' if franka else 'not a'} Franka arm; valid: {valid}"
        )
    if franka:
        state = robot_hw.get(FrankaStateInterface).handle(f"{arm_id}_robot").robot_state
        return state, robot_hw.get(FrankaModelInterface).handle(f"{arm_id}_model"), f"{arm_id}_link0"
    description, joints = root_node.search_param("robot_description"), list(group.names)
    tree = read(description)
    try:
        moving = parse_chain(description, tree.root, end_effector).joint_names
    except HricError as error:
        raise ParameterError(f"{where}: {error}") from error
    if list(moving) != joints:
        raise ParameterError(
            f"{where}: {end_effector} is moved by {', '.join(moving) or 'no joint'}; valid: a link moved by "
            f"{', '.join(joints)}, in this order"
        )
    base = tree.joints[joints[0]].parent
    arm = ChainArm(KdlChain(description, base, end_effector), group)
    return arm, arm, base
