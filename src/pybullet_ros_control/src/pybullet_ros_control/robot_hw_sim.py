"""Former module of `hric_control.sim.robot_hw_sim`, for one release."""

from hric_control.sim.robot_hw_sim import RobotHWSim

__all__ = ["RobotHWSim"]
