"""OpenSim plant: one robot, the world around it, and the external forces on both."""

from collections.abc import Mapping, Sequence

from hric_control.plant import Contact, FloatArray, JointReaction, ReactingPlant
from hric_control.plants import EnginePlant
from hric_core.geometry import MassProperties
from opensim_ros_control.robot import OpenSimConfig, OpenSimRobot
from opensim_ros_control.robot_model import RobotModel
from opensim_ros_control.world import OpenSimWorld
from urdf_to_osim import transforms


class OpenSimPlant(EnginePlant, ReactingPlant):
    """Physics plant on OpenSim: a robot, the world around it, and external forces; implements `hric_control.Plant`.

    The world is rotated in OpenSim's ground frame so that its z axis points along y of ground, which is up in OpenSim.
    All public values are in the world frame.

    Attributes:
        T_ground_world: pose of the world in OpenSim's ground, shape (4, 4).
    """

    config_type = OpenSimConfig
    config: OpenSimConfig
    robot: OpenSimRobot
    world: OpenSimWorld

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, object]) -> None:
        super().__init__(urdf_xml, joint_names, config)
        self.T_ground_world = transforms.base_pose("y")
        self.robot = OpenSimRobot(RobotModel(urdf_xml, self.gravity), self.joint_names, self.config)
        self.world = OpenSimWorld(self.robot, self._objects, self._rules, self.T_ground_world, self._masks)
        self._begin()

    def step(self) -> None:
        """Advance the simulation by `time_step`."""
        self.world.act()
        self.robot.step(self._values)

    def _set_loads(self, loads: Mapping[str, MassProperties]) -> None:
        model = self.robot.model
        before, model.loads = model.loads, loads
        try:
            self.robot.build_again()
        except BaseException:
            model.loads = before
            raise

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step."""
        return self.world.forces.contacts()

    def joint_reactions(self) -> list[JointReaction]:
        """Return force and torque in each moving joint of the robot in the last step; empty before the first step."""
        return self.world.reactions()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, shape (4, 4); twist of the link's origin, linear then angular, world axes, (6,))."""
        return self.world.state(body)
