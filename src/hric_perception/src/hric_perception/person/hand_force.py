"""Force on a person's hand, from the messages of the sensor that measures it. No node."""

from collections.abc import Callable
from typing import Any, NamedTuple

from geometry_msgs.msg import WrenchStamped

from franka_msgs.msg import FrankaState
from hric_core.geometry import Pose, transformed
from hric_core.geometry.quaternions import rotated
from hric_motion.live_load import HandForce
from hric_perception.person.settings import PLATE, ROBOT, HandForceSettings


class ForceSource(NamedTuple):
    """Topic of the sensor that measures the force on the hand, and the function that reads its messages.

    Attributes:
        topic, type: name, relative to the namespace around the node's, and type of the topic.
        read: function from time [s] and message to the force on the hand.
    """

    topic: str
    type: type
    read: Callable[[float, Any], HandForce]


def source_of(settings: HandForceSettings) -> ForceSource | None:
    """Return the topic from which the force on the hand is read; None if it is not measured."""
    if settings.source == ROBOT:
        topic = "franka_state_controller/franka_states"
        return ForceSource(topic, FrankaState, lambda time, message: of_robot(time, message, settings.pose))
    if settings.source == PLATE:
        topic = f"hric/perception/force_plate/{settings.id}/wrench"
        return ForceSource(topic, WrenchStamped, lambda time, message: of_plate(time, message, settings.pose))
    return None


def of_robot(time: float, message: Any, T_markers_base: Pose) -> HandForce:
    """Return the force of the robot on the hand in the markers' frame, from a franka_msgs/FrankaState.

    It is the estimated external wrench, which is what the arm exerts, at the origin of the stiffness frame K.
    """
    T, (kx, ky, kz) = message.O_T_EE, message.EE_T_K[12:15]
    x, y, z = (T[12 + i] + T[i] * kx + T[4 + i] * ky + T[8 + i] * kz for i in range(3))
    fx, fy, fz, mx, my, mz = message.O_F_ext_hat_K
    force, torque = (rotated(T_markers_base.orientation, vector) for vector in ((fx, fy, fz), (mx, my, mz)))
    return HandForce(time, force, torque, transformed(T_markers_base, (x, y, z)))


def of_plate(time: float, message: Any, T_markers_plate: Pose) -> HandForce:
    """Return the reaction of a force plate on the hand, in the markers' frame, from the load as WrenchStamped."""
    f, m = message.wrench.force, message.wrench.torque
    force, torque = (rotated(T_markers_plate.orientation, (-vector.x, -vector.y, -vector.z)) for vector in (f, m))
    return HandForce(time, force, torque, T_markers_plate.position)
