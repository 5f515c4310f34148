"""PyBullet plant: one robot, the world around it, and the external forces on both."""

from collections.abc import Mapping, Sequence

import numpy as np
import pybullet

from hric_control.plant import Contact, FloatArray
from hric_control.plants import EnginePlant
from hric_core.errors import FailureError
from hric_core.geometry import MassProperties
from pybullet_ros_control.bushings import PybulletBushings
from pybullet_ros_control.contact import rigid_contacts
from pybullet_ros_control.engine import PhysicsClient
from pybullet_ros_control.robot import PybulletRobot
from pybullet_ros_control.world import PybulletWorld


class PyBulletPlant(EnginePlant):
    """Physics plant on PyBullet: a robot, the world around it, and external forces; implements `hric_control.Plant`."""

    robot: PybulletRobot
    world: PybulletWorld

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, object]) -> None:
        super().__init__(urdf_xml, joint_names, config)
        self._engine = engine = PhysicsClient(self.config.gui, self.time_step, self.gravity)
        try:
            self.robot = PybulletRobot(engine, self.tree, self.joint_names, self.config, self._masks)
            self.world = PybulletWorld(engine, self.robot, self.tree, self._objects, self._rules, self.config)
            self.world.bushings = PybulletBushings(engine, self.world, self.robot, self.config)
            self._begin()
        except BaseException:
            self._engine.close()
            raise

    def close(self) -> None:
        """Release the engine; safe to call twice."""
        self._engine.close()

    def step(self) -> None:
        """Advance the simulation by `time_step`."""
        world = self.world
        pushing = world.wrenches.active or world.penalty.pairs or world.joints or world.bushings.laws
        try:
            self.robot.step(self._values, self._push() if pushing else None)
            if pushing:
                for joints in world.joints.values():
                    joints.refresh()
        except pybullet.error as error:
            raise FailureError(
                f"PyBullet cannot simulate any further: {error}"
                + ("; was its window closed?" if self.config.gui else "")
            ) from error

    def _push(self) -> list[float] | None:
        """Apply wrenches, penalty contact, bushings, and the joint efforts of models in the coming step.

        Returns the efforts of wrenches and penalty contact in the robot's joints [N m or N], None without a force.
        """
        world, robot = self.world, self.robot
        summed = [joints.body for joints in world.joints.values() if joints.fixed]
        world.forces.begin([robot.body, *summed] if robot.balanced else summed)
        for wrench in world.wrenches.active:
            body, link = world.body_of(wrench.body)
            index, T_body_frame = body.frame(link)
            T_world_link = self._engine.pose(body, index) @ T_body_frame
            point = T_world_link[:3, :3] @ wrench.point + T_world_link[:3, 3]
            world.forces.apply(body, index, wrench.force.tolist(), wrench.torque.tolist(), point.tolist())
        world.wrenches.count_step()
        if world.penalty.pairs:
            world.penalty.apply(world.forces, robot, world.joints)
        self.world.bushings.act()
        for joints in world.joints.values():
            joints.act(world.forces.efforts(joints.body))
        return world.forces.efforts(robot.body)

    def _set_loads(self, loads: Mapping[str, MassProperties]) -> None:
        # PyBullet's inverse dynamics ignores a changed mass, and may mistake a new body for a deleted one whose memory
        # address it has.
        self.robot.set_loads(loads)
        self.world.rebuild()

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step."""
        return self.world.penalty.last + rigid_contacts(self._engine, self.world.by_id)

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, shape (4, 4); twist of the link's origin, linear then angular, world axes, (6,))."""
        model, link = self.world.body_of(body)
        index, T_body_frame = model.frame(link)
        T_world_link = self._engine.pose(model, index) @ T_body_frame
        com, _, linear, angular = self._engine.motion(model, index)
        return T_world_link, np.concatenate([linear + np.cross(angular, T_world_link[:3, 3] - com), angular])
