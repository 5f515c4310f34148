"""Human arm that guides the robot's hand: same motion and force on all engines."""

import numpy as np
import pinocchio
import pytest

from hric_control.plant import Bushing
from hric_core import plugins
from hric_core.geometry.transforms import inverse
from hric_human.body import Subject, describe

PANDA = [f"panda_joint{i}" for i in range(1, 8)]
START = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0])
ARM_START = np.array([0.5, 0.2, 0.1, 1.3, 0.1, 0.0, 0.0])
WAY = np.array([0.4, 0.12, 0.08, -0.28, 0.08, 0.0, 0.0])
"""Amplitude of the motion of the arm's joints, forth and back [rad]."""
SHOULDER = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.1], [0.0, 0.0, 1.0, 0.9], [0.0, 0.0, 0.0, 1.0]])


class Law:
    """Return joint torques of stiffness, damping and gravity compensation for a chain of seven joints."""

    def __init__(self, urdf, stiffness, damping):
        self.model = pinocchio.buildModelFromXML(urdf)
        self.data = self.model.createData()
        self.stiffness, self.damping = np.array(stiffness), np.array(damping)

    def __call__(self, q, dq, target):
        gravity = pinocchio.computeGeneralizedGravity(self.model, self.data, np.array(q))
        return (gravity + self.stiffness * (target - q) - self.damping * dq).tolist()


def guidance(engine, panda_urdf, duration):
    """Return the joint positions of both and the force between them at each step, shape (steps, 17)."""
    arm = describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male", parts="right_arm")).urdf
    plant = plugins.find(plugins.PLANT, engine)(panda_urdf, PANDA, {})
    robot, human = Law(panda_urdf, [20.0] * 7, [4.0] * 7), Law(arm, [60, 60, 30, 60, 10, 10, 10], [6, 6, 3, 6, 1, 1, 1])
    plant.spawn("human", arm, SHOULDER, fixed=True)
    plant.set_joints("human", ARM_START)
    plant.reset(START)
    T_hand_wrist = inverse(plant.link_state("panda_hand")[0]) @ plant.link_state("human::r_wrist")[0]
    plant.connect("grip", Bushing("panda_hand", "human::r_wrist", T_hand_wrist, np.eye(4)))
    q, dq, tau, arm_q, arm_dq = ([0.0] * 7 for _ in range(5))
    rows = []
    for k in range(round(duration * 1e3)):
        plant.read_state(q, dq, tau)
        plant.read_joints("human", arm_q, arm_dq)
        rows.append([*q, *arm_q, *plant.bushing_load("grip").force])
        plant.apply(robot(np.array(q), np.array(dq), START))
        target = ARM_START + WAY * 0.5 * (1.0 - np.cos(2e-3 * np.pi * k / 3.0))
        plant.drive_joints("human", human(np.array(arm_q), np.array(arm_dq), target))
        plant.step()
    plant.close()
    return np.array(rows)


@pytest.mark.parametrize("engine", ["pybullet_ros_control/PyBulletPlant", "opensim_ros_control/OpenSimPlant"])
def test_a_guided_robot_moves_as_on_the_engine_with_runge_kutta(panda_urdf, engine):
    reference = guidance("mujoco_ros_control/MujocoPlant", panda_urdf, 6.0)
    error = np.abs(guidance(engine, panda_urdf, 6.0) - reference).max(axis=0)
    print(f"{engine}: joints within {error[:14].max():.1e} rad, force within {error[14:].max():.1e} N")
    assert np.ptp(reference[:, :7], axis=0).max() > 0.15
    assert np.ptp(reference[:, 14:], axis=0).max() > 15.0
    assert error[:14].max() < 3e-5
    assert error[14:].max() < 0.005
