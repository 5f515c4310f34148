"""Arm of a person in MuJoCo beside a still robot: the hand is pulled, or moves."""

from types import TracebackType

import numpy as np

from hric_core import plugins
from hric_core.geometry import FloatArray, Vector
from hric_human.control import HumanControl

CYCLE = 1e-3
"""Time between two updates [s]."""
NAME = "human"
POST = (
    '<robot name="post"><link name="world"/><link name="knob"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="axle" type="continuous"><parent link="world"/><child link="knob"/><axis xyz="0 0 1"/></joint></robot>'
)
"""Description of the robot that each plant needs: one link that turns about a vertical axis [URDF]."""


class ArmInPlant:
    """Arm of a person that a control drives in MuJoCo; a context manager that closes the plant.

    Args:
        control: control of the person's right arm.
    """

    def __init__(self, control: HumanControl) -> None:
        plant = plugins.find(plugins.PLANT, "mujoco_ros_control/MujocoPlant")
        self._control, self._plant = control, plant(POST, ["axle"], {})
        self._plant.spawn(NAME, control.person.body.urdf, np.eye(4), fixed=True)
        self._time = 0.0
        self._plant.set_joints(NAME, control.posture)
        control.start(0.0)

    def __enter__(self) -> "ArmInPlant":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._plant.close()

    def moved(self, duration: float) -> FloatArray:
        """Let the arm move for a time [s]; return the hand's positions after each cycle, shape (n, 3) [m]."""
        q, dq = [0.0] * len(self._control.person.joints), [0.0] * len(self._control.person.joints)
        positions = []
        for _ in range(round(duration / CYCLE)):
            self._plant.read_joints(NAME, q, dq)
            self._plant.drive_joints(NAME, self._control.update(self._time, q, dq))
            self._plant.apply([0.0])
            self._plant.step()
            self._time += CYCLE
            positions.append(self._control.person.hand.pose(q).position)
        return np.array(positions)

    def pulled(self, force: Vector, duration: float) -> FloatArray:
        """Pull the hand with a force [N] for a time [s]; return its last position, shape (3,) [m]."""
        hand = self._control.person.hand
        self._plant.apply_wrench(f"{NAME}::r_wrist", force, (0.0, 0.0, 0.0), hand.p_link_hand, duration)
        return np.asarray(self.moved(duration)[-1])
