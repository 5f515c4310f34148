"""ROS services `franka_control/...` and recovery action of franka_ros, for the simulated and the real arm."""

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

from franka_hw_interface.transforms import check_frame, check_load
from franka_msgs.msg import ErrorRecoveryAction
from franka_msgs.srv import (
    SetCartesianImpedance,
    SetEEFrame,
    SetForceTorqueCollisionBehavior,
    SetFullCollisionBehavior,
    SetJointImpedance,
    SetKFrame,
    SetLoad,
)
from hric_core.errors import CommandError, HricError
from hric_core.node import GoalHandle, Node, Registration
from hric_core.parameters import Settings, numbers


@dataclass(frozen=True)
class CollisionThresholds(Settings):
    """Thresholds of external torques and wrenches for contact (lower) and collision (upper), as in libfranka.

    Torques: one per joint [N m]. Forces: x, y, z [N], then moments about these axes [N m], on the stiffness frame.
    `acceleration`: while the desired motion accelerates; `nominal`: otherwise.
    """

    lower_torque_thresholds_acceleration: tuple[float, ...] = numbers(7, minimum=0.0, unit="N m")
    upper_torque_thresholds_acceleration: tuple[float, ...] = numbers(7, minimum=0.0, unit="N m")
    lower_torque_thresholds_nominal: tuple[float, ...] = numbers(7, minimum=0.0, unit="N m")
    upper_torque_thresholds_nominal: tuple[float, ...] = numbers(7, minimum=0.0, unit="N m")
    lower_force_thresholds_acceleration: tuple[float, ...] = numbers(6, minimum=0.0, unit="N, N m")
    upper_force_thresholds_acceleration: tuple[float, ...] = numbers(6, minimum=0.0, unit="N, N m")
    lower_force_thresholds_nominal: tuple[float, ...] = numbers(6, minimum=0.0, unit="N, N m")
    upper_force_thresholds_nominal: tuple[float, ...] = numbers(6, minimum=0.0, unit="N, N m")

    def lists(self) -> list[list[float]]:
        """Return the eight lists in the order of libfranka's setCollisionBehavior."""
        return [list(getattr(self, item.name)) for item in fields(self)]


class ServedArm(Protocol):
    """Interface of an arm whose settings the services franka_control/... change.

    A method that refuses a value raises a HricError with the reason. `request` calls all others.
    """

    def request(self, function: Callable[[], None]) -> None:
        """Call `function` between two cycles of the control loop and wait for it; its error is raised here."""

    def set_load(self, mass: float, com: Sequence[float], inertia: Sequence[float]) -> None:
        """Set mass [kg], centre of mass in the flange, 3 floats [m], inertia, 9 floats column-major [kg m^2]."""

    def set_EE_frame(self, NE_T_EE: Sequence[float]) -> None:
        """Set the end effector in the nominal end-effector frame, 16 floats column-major."""

    def set_K_frame(self, EE_T_K: Sequence[float]) -> None:
        """Set the stiffness frame in the end-effector frame, 16 floats column-major."""

    def set_joint_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the stiffness of the internal joint impedance, 7 floats [N m/rad]."""

    def set_cartesian_impedance(self, stiffness: Sequence[float]) -> None:
        """Set the internal Cartesian stiffness in the stiffness frame, 3 floats [N/m], then 3 [N m/rad]."""

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the contact and collision thresholds."""

    def recover(self) -> None:
        """Run automatic error recovery; return when the arm can be commanded again."""


def positive(values: Sequence[float], n: int, what: str) -> list[float]:
    """Return the values as floats, after a check that there are n, all finite and not negative.

    Raises:
        CommandError: the check fails; `what` names the values in its text.
    """
    result = [float(value) for value in values]
    if len(result) != n or not all(math.isfinite(value) and value >= 0.0 for value in result):
        raise CommandError(f"{what} must be {n} finite numbers of 0 or more; got {result}")
    return result


class ArmServices:
    """ROS services `franka_control/set_...` and the action `franka_control/error_recovery` of an arm.

    A refused request gets success=False and the reason in `error`; a failed recovery aborts the goal with the reason as
    text.

    Args:
        arm: arm that executes the requests.
        root_node: namespace of the robot.
    """

    def __init__(self, arm: ServedArm, root_node: Node) -> None:
        self._arm = arm
        node = self._node = root_node.child("franka_control")
        services: dict[str, tuple[Any, Callable[[Any], None]]] = {
            "set_load": (SetLoad, self._load),
            "set_EE_frame": (SetEEFrame, self._ee_frame),
            "set_K_frame": (SetKFrame, self._k_frame),
            "set_joint_impedance": (SetJointImpedance, self._joint_impedance),
            "set_cartesian_impedance": (SetCartesianImpedance, self._cartesian_impedance),
            "set_force_torque_collision_behavior": (SetForceTorqueCollisionBehavior, self._collision),
            "set_full_collision_behavior": (SetFullCollisionBehavior, self._full_collision),
        }
        self._open: list[Registration] = [
            node.service(name, kind, self._handler(kind, apply)) for name, (kind, apply) in services.items()
        ]
        self._open.append(node.action_server("error_recovery", ErrorRecoveryAction, self._on_goal, self._on_cancel))

    def unregister(self) -> None:
        """Unregister services and action."""
        while self._open:
            self._open.pop().unregister()

    def _handler(self, kind: Any, apply: Callable[[Any], None]) -> Callable[[Any], Any]:
        def handler(request: Any) -> Any:
            try:
                apply(request)
            except HricError as error:
                return kind._response_class(success=False, error=str(error))
            return kind._response_class(success=True, error="")

        return handler

    def _load(self, request: Any) -> None:
        load = check_load(request.mass, request.F_x_center_load, request.load_inertia)
        self._arm.request(lambda: self._arm.set_load(load.mass, load.com.tolist(), list(request.load_inertia)))

    def _ee_frame(self, request: Any) -> None:
        check_frame(request.NE_T_EE, "NE_T_EE")
        self._arm.request(lambda: self._arm.set_EE_frame(list(request.NE_T_EE)))

    def _k_frame(self, request: Any) -> None:
        check_frame(request.EE_T_K, "EE_T_K")
        self._arm.request(lambda: self._arm.set_K_frame(list(request.EE_T_K)))

    def _joint_impedance(self, request: Any) -> None:
        stiffness = positive(request.joint_stiffness, 7, "joint_stiffness")
        self._arm.request(lambda: self._arm.set_joint_impedance(stiffness))

    def _cartesian_impedance(self, request: Any) -> None:
        stiffness = positive(request.cartesian_stiffness, 6, "cartesian_stiffness")
        self._arm.request(lambda: self._arm.set_cartesian_impedance(stiffness))

    def _collision(self, request: Any) -> None:
        torques = request.lower_torque_thresholds_nominal, request.upper_torque_thresholds_nominal
        forces = request.lower_force_thresholds_nominal, request.upper_force_thresholds_nominal
        # As in franka_ros, the thresholds are the same while accelerating and at steady motion.
        thresholds = CollisionThresholds(*torques, *torques, *forces, *forces)
        self._arm.request(lambda: self._arm.set_collision_behavior(thresholds))

    def _full_collision(self, request: Any) -> None:
        thresholds = CollisionThresholds(
            **{item.name: getattr(request, item.name) for item in fields(CollisionThresholds)}
        )
        self._arm.request(lambda: self._arm.set_collision_behavior(thresholds))

    # -- the action ----------------------------------------------------------------------------------------------------

    def _on_goal(self, goal: GoalHandle) -> None:
        goal.accept()
        if self._node.publishes_inline:  # one thread only: run here
            self._recover(goal)
        else:  # a recovery takes seconds, and actionlib holds a lock here
            threading.Thread(target=self._recover, args=[goal], name="error_recovery", daemon=True).start()

    def _recover(self, goal: GoalHandle) -> None:
        try:
            self._arm.request(self._arm.recover)
        except HricError as error:
            self._node.log_error(f"error_recovery: {error}")
            goal.abort(None, str(error))
            return
        goal.succeed(None)

    def _on_cancel(self, goal: GoalHandle) -> None:
        """Ignore the request: a recovery that has started is completed, since libfranka cannot cancel it."""
