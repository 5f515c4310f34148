"""Bushings: springs and dampers that hold two links of PyBullet bodies together.

Their law uses positions and velocities at the start of the step, the measuring instant, as in the other plants. The
load is constant over the step. On a link of a body with a fixed base it is applied as joint efforts J'F, which need no
call of the engine and are known to the joint dynamics in advance; on other links as an external force of the engine.
The engine's positions belong to the middle of the step, so the point of application moves with body b to that instant.
"""

from typing import Protocol

from hric_control.plants import BushingLaw, Bushings, LinkMotion, PlantConfig
from hric_core.geometry import quaternions
from hric_core.geometry.quaternions import Vector, cross, rotated
from hric_core.geometry.transforms import inverse, quaternion_from_rotation
from pybullet_ros_control.engine import LoadedBody, PhysicsClient
from pybullet_ros_control.external_forces import ExternalForces
from pybullet_ros_control.joint_dynamics import frame_of, half_step
from pybullet_ros_control.model_joints import PybulletModelJoints
from pybullet_ros_control.robot import PybulletRobot
from pybullet_ros_control.world import PybulletWorld


class _End(Protocol):
    """Link at one end of a bushing."""

    def motion(self) -> LinkMotion:
        """Return the motion of the link at the measuring instant."""

    def push(self, force: Vector, torque: Vector, point: Vector) -> None:
        """Apply a force [N] at a point [m] and a torque [N m] in the coming step, world frame."""


class _JointedEnd:
    """Link, at an end of a bushing, of a body with a fixed base and joints; loads become joint efforts."""

    def __init__(self, joints: PybulletRobot | PybulletModelJoints, link: str) -> None:
        assert joints.body.model is not None
        self._joints = joints
        self._joint, self._frame = frame_of(joints.body.model, joints.joints.names, joints.T_world_base, link)

    def motion(self) -> LinkMotion:
        joints = self._joints
        return LinkMotion(*joints.dynamics.motion(joints.at, joints.dq, self._joint, self._frame))

    def push(self, force: Vector, torque: Vector, point: Vector) -> None:
        joints = self._joints
        joints.hold(joints.dynamics.efforts(joints.q, self._joint, force, torque, point))


class _FreeEnd:
    """Link, at an end of a bushing, of a body with a free base or without joints; loads become forces of the engine."""

    def __init__(self, engine: PhysicsClient, forces: ExternalForces, body: LoadedBody, link: str, half: float) -> None:
        self._engine, self._forces, self._body, self._half = engine, forces, body, half
        self._index, T_body_link = body.frame(link)
        T_com_link = inverse(engine.inertial_frame(body, self._index)) @ T_body_link
        x, y, z = T_com_link[:3, 3].tolist()
        self._lever, self._rotation = (x, y, z), quaternion_from_rotation(T_com_link[:3, :3])

    def motion(self) -> LinkMotion:
        com, (x, y, z, w), linear, spin = self._engine.motion(self._body, self._index)
        orientation, angular = (x, y, z, w), (spin[0], spin[1], spin[2])
        lever = rotated(orientation, self._lever)
        velocity = _moved(_vector(linear), cross(angular, lever), 1.0)
        back = quaternions.from_rotation_vector([-self._half * rate for rate in angular])
        return LinkMotion(
            _moved(_moved(_vector(com), lever, 1.0), velocity, -self._half),
            quaternions.product(back, quaternions.product(orientation, self._rotation)),
            velocity,
            angular,
        )

    def push(self, force: Vector, torque: Vector, point: Vector) -> None:
        self._forces.apply(self._body, self._index, force, torque, point)


class PybulletBushings(Bushings):
    """All bushings of a PyBullet plant, and the application of their loads.

    Args:
        engine: engine with the bodies.
        world: bodies by name, the robot included.
        robot: robot in the world.
        config: parameters of the plant.
    """

    def __init__(self, engine: PhysicsClient, world: PybulletWorld, robot: PybulletRobot, config: PlantConfig) -> None:
        super().__init__(world.full_name, world.near)
        self._engine, self._world, self._robot, self._half = engine, world, robot, half_step(config)
        self._acting: list[tuple[BushingLaw, _End, _End]] = []

    def bind(self) -> None:
        """Find the links of all bushings in the engine, after bodies were loaded again or bushings were added."""
        self._world.keep_apart(self.apart())
        self._robot.mask()
        self._acting = [
            (law, self._end(law.bushing.body_a), self._end(law.bushing.body_b)) for law in self.laws.values()
        ]

    def _end(self, name: str) -> _End:
        body, link = self._world.body_of(name)
        if body is self._robot.body:
            return _JointedEnd(self._robot, link)
        joints = self._world.joints.get(body.name)
        if joints is not None and joints.fixed:
            return _JointedEnd(joints, link)
        return _FreeEnd(self._engine, self._world.forces, body, link, self._half)

    def act(self) -> None:
        """Apply the load of each bushing to its two links in the coming step."""
        for law, a, b in self._acting:
            motion = b.motion()
            force, torque, point, *_ = law.step(a.motion(), motion)
            lever = point[0] - motion.position[0], point[1] - motion.position[1], point[2] - motion.position[2]
            there = _moved(_moved(point, motion.linear, self._half), cross(motion.angular, lever), self._half)
            a.push(force, torque, there)
            b.push(_opposite(force), _opposite(torque), there)


def _vector(values: tuple[float, ...]) -> Vector:
    return values[0], values[1], values[2]


def _moved(point: Vector, rate: Vector, by: float) -> Vector:
    """Return point + by * rate."""
    return point[0] + by * rate[0], point[1] + by * rate[1], point[2] + by * rate[2]


def _opposite(v: Vector) -> Vector:
    return -v[0], -v[1], -v[2]
