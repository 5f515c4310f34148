"""Gravity torque and mass matrix of a controller's joints, and the maximum derivative gain of a sampled torque loop.

Gravity comes from the robot's model interface if it has one, else from KDL and robot_description.

A damping torque -Kd_i dq_i, constant over one period dt, changes the velocity of joint i by dt ((M + B)^-1)_ii Kd_i
dq_i. If this change is more than twice the velocity, the velocity grows from cycle to cycle, so the loop is stable for
Kd_i <= 2 / (dt ((M + B)^-1)_ii). M is the mass matrix at the present pose, B the rotor inertia.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from franka_hw_interface.interfaces import FrankaModelInterface
from franka_hw_interface.kdl_chain import KdlChain
from hric_control.hardware_interface import JointStateInterface
from hric_control.robot_hw import RobotHW
from hric_controllers.joint.pd_law import Gravity
from hric_core.errors import DescriptionError, HricError, ParameterError
from hric_core.node import Node
from hric_core.urdf import Robot, mimic_laws, read

FloatArray = npt.NDArray[np.float64]


class ChainDynamics:
    """Gravity and mass matrix of a controller's joints, from the KDL chain through them in the robot description.

    Joints of the chain that the controller does not have take part at their measured positions.

    An instance may be used by one thread only.
    """

    def __init__(self, chain: KdlChain, robot_hw: RobotHW, joints: Sequence[str]) -> None:
        self._chain = chain
        self._states = robot_hw.get(JointStateInterface).group(chain.joint_names)
        self._order = [chain.joint_names.index(joint) for joint in joints]
        self.gravity: Gravity = chain.gravity_list if list(joints) == list(chain.joint_names) else self._reordered
        """Function that maps joint positions (n floats [rad]) to gravity torques (n floats [N m])."""
        frozen = ", ".join(chain.description.frozen_joints)
        self.assumed = f", with {frozen} at 0" if frozen else ""
        """Text on the positions of joints beside the chain, for the user; empty: there are none."""

    def _reordered(self, q: list[float]) -> list[float]:
        torque = self._chain.gravity_list(self._states.positions())
        return [torque[i] for i in self._order]

    def mass(self) -> FloatArray:
        """Return the mass matrix at the present position, shape (n, n) [kg m^2]."""
        full: FloatArray = self._chain.mass(self._states.positions())
        return full[np.ix_(self._order, self._order)]


def added_gravity(robot_hw: RobotHW, root_node: Node, node: Node, joints: Sequence[str]) -> Gravity:
    """Return the gravity torque function of a controller with `gravity: true`.

    Raises:
        HricError: the arm compensates gravity itself, or there is no dynamic model of its joints.
    """
    if robot_hw.compensates_gravity:
        raise HricError(
            f"{node.resolve('gravity')} is true, but both the arm {type(robot_hw).__name__} and the controller "
            f"{node.namespace.rsplit('/', 1)[-1]} would add g(q); valid with this arm: gravity: false"
        )
    gravity, source = gravity_source(robot_hw, root_node, joints)
    node.log_info(f"the controller adds the gravity torque g(q), computed by {source}")
    return gravity


def gravity_source(robot_hw: RobotHW, root_node: Node, joints: Sequence[str]) -> tuple[Gravity, str]:
    """Return a gravity torque function for these joints, callable in the loop, and the name of its source for the user.

    The robot's model interface has priority over KDL, since it includes the configured end effector and load.

    Raises:
        HricError: no model interface for these joints, and no description with one serial chain through them.
    """
    if robot_hw.has(FrankaModelInterface):
        interface = robot_hw.get(FrankaModelInterface)
        for name in interface.names:
            arm = [f"{name.removesuffix('_model')}_joint{i}" for i in range(1, 8)]
            if set(joints) <= set(arm):
                return _model_gravity(
                    interface.handle(name), [arm.index(joint) for joint in joints]
                ), "the robot's model interface"
    dynamics = chain_dynamics(robot_hw, root_node, joints)
    return dynamics.gravity, "KDL from robot_description" + dynamics.assumed


def _model_gravity(model: Any, order: list[int]) -> Gravity:
    all_in_order = order == list(range(7))

    def gravity(q: list[float]) -> list[float]:
        torque: list[float] = model.gravity().tolist()  # at the robot's present position, which is q
        return torque if all_in_order else [torque[i] for i in order]

    return gravity


def chain_dynamics(robot_hw: RobotHW, root_node: Node, joints: Sequence[str]) -> ChainDynamics:
    """Return the dynamics of the joints from a new KDL chain.

    Raises:
        HricError: there is no description, or no serial chain through all joints in it.
    """
    return ChainDynamics(_chain(root_node.search_param("robot_description"), joints), robot_hw, joints)


def _chain(urdf_xml: str, joints: Sequence[str]) -> KdlChain:
    """Return the KDL chain from the root link of the description to the link that the outermost joint moves."""
    robot = read(urdf_xml)
    problem = f"no joint of {', '.join(joints)} is in robot_description"
    for joint in reversed(joints):
        if joint not in robot.joints:
            continue
        tip = robot.joints[joint].child
        chain = KdlChain(urdf_xml, robot.root, tip)
        missing = [name for name in joints if name not in chain.joint_names]
        if not missing:
            _check_no_followers(robot, chain)
            return chain
        problem = f"{', '.join(missing)} not on the chain from {robot.root} to {tip} ({', '.join(chain.joint_names)})"
    raise DescriptionError(f"dynamics need one serial chain through all joints: {problem}")


def _check_no_followers(robot: Robot, chain: KdlChain) -> None:
    """Raise DescriptionError if a joint mimics one of the chain: the KDL chain lacks the torque that it transmits."""
    for name, law in mimic_laws(robot.joints).items():
        if law.joint in chain.joint_names:
            raise DescriptionError(
                f"dynamics need joints that move on their own: {name} mimics {law.joint}, and its weight and inertia "
                "are not known at other positions than 0; valid: gravity: false and a controller of joint positions, "
                f"or a description in which {name} is fixed"
            )


def largest_kd(mass: FloatArray, rotor_inertia: Sequence[float], period: float) -> list[float]:
    """Return the upper bound of each derivative gain, n floats [N m s/rad].

    Args:
        mass: joint-space mass matrix, shape (n, n) [kg m^2].
        rotor_inertia: rotor inertia reflected to the joints, n floats [kg m^2].
        period: period of the control loop [s].
    """
    inverse = np.linalg.inv(mass + np.diag(rotor_inertia))
    return [2.0 / (period * float(value)) for value in np.diagonal(inverse)]


def rotor_inertia(
    robot_hw: RobotHW, parameter: Sequence[float] | None, joints: Sequence[str]
) -> tuple[list[float], str]:
    """Return the joints' rotor inertias, n floats [kg m^2], and their source as a text for the user.

    Source: the parameter `rotor_inertia` if set, else the robot's values, else zero.
    """
    if parameter is not None:
        return list(parameter), "parameter rotor_inertia"
    if robot_hw.rotor_inertia is None:
        return [0.0] * len(joints), "taken as 0, since neither the parameter rotor_inertia nor the robot gives it"
    index = robot_hw.get(JointStateInterface).states.index
    return [float(robot_hw.rotor_inertia[index[joint]]) for joint in joints], "from the robot"


def kd_check(
    robot_hw: RobotHW,
    root_node: Node,
    node: Node,
    joints: Sequence[str],
    rotors: Sequence[float] | None,
    strict: bool,
) -> Callable[[Sequence[float]], None]:
    """Return a function that compares derivative gains, n floats [N m s/rad], with their bounds at the present pose.

    For larger gains it logs a warning, or raises ParameterError if `strict`. Not to be called in the loop.

    Args:
        robot_hw: robot with the joints.
        root_node: namespace of robot_description.
        node: namespace of the controller.
        joints: names, in the order of the gains.
        rotors: the parameter `rotor_inertia`, n floats [kg m^2]; None if it is not set.
        strict: the parameter `strict_gains`.

    Raises:
        HricError: there is no dynamic model, with `strict`. (Without `strict`, gains are then not checked.)
    """
    inertia, source = rotor_inertia(robot_hw, rotors, joints)
    period = robot_hw.period
    try:
        dynamics = chain_dynamics(robot_hw, root_node, joints)
    except HricError as error:
        if strict:
            raise
        node.log_info(f"derivative gains are not checked: {error}")
        return lambda kd: None

    def check(kd: Sequence[float]) -> None:
        unstable = _unstable(joints, kd, largest_kd(dynamics.mass(), inertia, period))
        text = (
            f"derivative gain too large for a {1e3 * period:g} ms loop at this pose: {unstable}; "
            f"bound 2 / (dt ((M+B)^-1)_ii), rotor inertia B {source}"
        )
        if unstable and strict:
            raise ParameterError(f"{text}; it is refused because the parameter strict_gains is true")
        if unstable:
            node.log_warn(f"{text}; the joints may vibrate")

    return check


def _unstable(joints: Sequence[str], kd: Sequence[float], bounds: Sequence[float]) -> str:
    """Return the joints whose gain exceeds its bound as a text, empty if there are none."""
    pairs = zip(joints, kd, bounds, strict=True)
    return ", ".join(f"{joint} {gain:.4g} (at most {bound:.3g})" for joint, gain, bound in pairs if gain > bound)
