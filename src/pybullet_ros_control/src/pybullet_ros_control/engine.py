"""Access to one PyBullet physics client: settings, loading of models, reading and setting of states."""

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pybullet

from hric_control.plants import MovingJoints
from hric_core.errors import HricError, UnknownNameError
from hric_core.geometry import transforms
from hric_core.urdf import mimic_laws
from pybullet_ros_control.urdf_model import EngineModel

_MAX_JOINT_VELOCITY = 1e6
"""Joint velocity at which the engine clips [rad/s]; its default of 100 rad/s is too low."""


GEAR_FORCE = 1e9
"""Maximum effort of a gear constraint [N m or N]; practically no limit. The value does not affect the stiffness."""
NO_RATIO = 1e-300
"""Ratio of the gear of a mimic joint with multiplier 0 [1]: the engine does not accept zero."""
SLACK = 1e-12
"""Deviation of a mimic joint beyond which its state is corrected [rad or m, rad/s or m/s] (unconfirmed default)."""


@dataclass
class LoadedBody:
    """Body that is loaded in PyBullet.

    Attributes:
        name: name of the model.
        id: PyBullet's number of the body.
        model: prepared model; None for a plain shape.
        links: engine index by link name; the base is -1.
        joints: engine index by name of the moving joints.
        parents: engine index of the parent, by engine index of each link except the base.
        gears: PyBullet's numbers of the gear constraints of mimic joints.
    """

    name: str
    id: int
    model: EngineModel | None
    links: dict[str, int]
    joints: dict[str, int]
    parents: dict[int, int]
    gears: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.link_names = {index: name for name, index in self.links.items()}

    def frame(self, link: str) -> tuple[int, transforms.FloatArray]:
        """Return (engine index of the link that carries it, pose in that link, shape (4, 4)) of a described link.

        Raises:
            UnknownNameError: the model has no such link.
        """
        links = self.links if self.model is None else self.model.frames
        if link not in links:
            raise UnknownNameError("link", link, links, self.name)
        if self.model is None:
            return self.links[link], np.eye(4)
        frame = self.model.frames[link]
        return self.links[frame.body_link], frame.T_body_frame


@dataclass(frozen=True)
class BodyState:
    """State of a body in PyBullet.

    Attributes:
        position, orientation: pose of the base's centre of mass in the world [m], quaternion (x, y, z, w).
        linear, angular: velocity of the base's centre of mass [m/s], [rad/s].
        joints: (position, velocity) by joint name.
    """

    position: tuple[float, ...]
    orientation: tuple[float, ...]
    linear: tuple[float, ...]
    angular: tuple[float, ...]
    joints: dict[str, tuple[float, float]]


def _check_display() -> None:
    """Raise a HricError if there is no X display, since PyBullet would then end the complete process."""
    display = os.environ.get("DISPLAY", "")
    local = display.removeprefix("unix").partition(":")
    socket = Path("/tmp/.X11-unix") / f"X{local[2].split('.')[0]}"
    if not display or (local[0] == "" and not socket.exists()):
        raise HricError(
            f"gui: true needs a display; DISPLAY is {display!r}. Set gui: false, or start a display (for example Xvfb)"
        )


class PhysicsClient:
    """PyBullet physics client. Several can exist in one process without affecting each other.

    Args:
        gui: True to open a window.
        time_step: duration of a step [s].
        gravity: gravity in the world frame, 3 floats [m/s^2].

    Raises:
        HricError: there is no display for the window, or PyBullet refuses another client.
    """

    def __init__(self, gui: bool, time_step: float, gravity: Sequence[float]) -> None:
        self.time_step, self.gravity, self.gui = time_step, tuple(gravity), gui
        if gui:
            _check_display()
        self.client: int = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        if self.client < 0:
            raise HricError("PyBullet refused to connect" + (" (one window per process)" if gui else ""))
        self.settings()

    def settings(self) -> None:
        """Remove all bodies, then set gravity, time step and engine parameters again."""
        client = self.client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(*self.gravity, physicsClientId=client)
        pybullet.setTimeStep(self.time_step, physicsClientId=client)
        # No sub-steps: they reduce the engine's contact forces by the number of sub-steps.
        pybullet.setPhysicsEngineParameter(
            numSubSteps=0, enableFileCaching=0, deterministicOverlappingPairs=1, physicsClientId=client
        )
        if self.gui:
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=client)

    def close(self) -> None:
        """Disconnect; safe to call twice."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def load(
        self,
        name: str,
        model: EngineModel,
        T_world_root: transforms.FloatArray,
        *,
        fixed_base: bool,
        self_collision: bool,
    ) -> LoadedBody:
        """Load a prepared model into the engine and return the body.

        Args:
            name: name of the body.
            model: prepared model.
            T_world_root: pose of the root link, shape (4, 4).
            fixed_base: True: the root link is fixed to the world.
            self_collision: True: links of the body can touch each other.

        Raises:
            HricError: the engine cannot load the model.
        """
        # Without this flag a cylinder would be a hull of 64 corners with a margin of 1 mm.
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER
        if self_collision:  # the plant, not the engine, excludes pairs
            flags |= pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_USE_SELF_COLLISION_INCLUDE_PARENT
        T = T_world_root @ model.T_root_base
        pose = T[:3, 3].tolist(), transforms.quaternion_from_rotation(T[:3, :3])
        # Deleted right after loading: otherwise a killed process would leave the folder behind.
        with tempfile.TemporaryDirectory(prefix="hric_plant_") as folder:
            path = Path(folder) / "model.urdf"
            for file, content in model.files.items():
                (path.parent / file).write_bytes(content)
            path.write_text(model.xml, encoding="utf-8")
            try:
                body_id = pybullet.loadURDF(
                    str(path), *pose, useFixedBase=fixed_base, flags=flags, physicsClientId=self.client
                )
            except pybullet.error as error:
                raise HricError(f"PyBullet cannot load {name}: {error}") from error
        body = self._index(name, body_id, model)
        self._set_dynamics(body)
        self.motors_off(body)
        self._add_gears(body)
        return body

    def _add_gears(self, body: LoadedBody) -> None:
        """Add gear constraints for mimic joints, so that the engine's contacts and joint stops act on both joints."""
        assert body.model is not None
        for name, law in mimic_laws(body.model.joints).items():
            joints, axis, origin = (body.joints[name], body.joints[law.joint]), [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]
            gear = pybullet.createConstraint(
                body.id,
                joints[0],
                body.id,
                joints[1],
                pybullet.JOINT_GEAR,
                axis,
                origin,
                origin,
                physicsClientId=self.client,
            )
            pybullet.changeConstraint(
                gear, gearRatio=-law.multiplier or NO_RATIO, erp=0.0, maxForce=GEAR_FORCE, physicsClientId=self.client
            )
            body.gears.append(gear)

    def _index(self, name: str, body_id: int, model: EngineModel) -> LoadedBody:
        links, joints, parents = {model.base: -1}, {}, {}
        for index in range(pybullet.getNumJoints(body_id, physicsClientId=self.client)):
            info = pybullet.getJointInfo(body_id, index, physicsClientId=self.client)
            links[info[12].decode()] = index
            parents[index] = info[16]
            if info[2] != pybullet.JOINT_FIXED:
                joints[info[1].decode()] = index
        return LoadedBody(name, body_id, model, links, joints, parents)

    def _set_dynamics(self, body: LoadedBody) -> None:
        """Switch off the engine's default damping, raise its speed limit, and set the exact principal moments."""
        assert body.model is not None
        for link, index in body.links.items():
            dampings = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": 0.0}
            pybullet.changeDynamics(
                body.id, index, maxJointVelocity=_MAX_JOINT_VELOCITY, physicsClientId=self.client, **dampings
            )
            moments = body.model.moments.get(link)
            if moments is None:
                continue
            # In a separate call: together with the settings above the engine ignores it.
            pybullet.changeDynamics(body.id, index, localInertiaDiagonal=moments, physicsClientId=self.client)
            info = pybullet.getDynamicsInfo(body.id, index, physicsClientId=self.client)
            if info[0] != body.model.bodies[link].mass or tuple(info[2]) != moments:
                raise HricError(
                    f"PyBullet did not accept the mass of {body.name}::{link}: it uses {info[0]} kg and the principal "
                    f"moments {info[2]} kg m^2"
                )

    def state(self, body: LoadedBody) -> BodyState:
        """Return pose, velocity and joint states of a body."""
        position, orientation = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self.client)
        linear, angular = pybullet.getBaseVelocity(body.id, physicsClientId=self.client)
        joints = {
            name: pybullet.getJointState(body.id, i, physicsClientId=self.client)[:2] for name, i in body.joints.items()
        }
        return BodyState(position, orientation, linear, angular, joints)

    def set_state(self, body: LoadedBody, state: BodyState) -> None:
        """Set pose, velocity and joint states of a body, e.g. those of its predecessor of the same model."""
        pybullet.resetBasePositionAndOrientation(
            body.id, state.position, state.orientation, physicsClientId=self.client
        )
        pybullet.resetBaseVelocity(body.id, state.linear, state.angular, physicsClientId=self.client)
        for name, (q, dq) in state.joints.items():
            pybullet.resetJointState(body.id, body.joints[name], q, dq, physicsClientId=self.client)

    def motors_off(self, body: LoadedBody) -> None:
        """Switch off the motors by which PyBullet brakes every joint by default."""
        indices = list(body.joints.values())
        if indices:
            pybullet.setJointMotorControlArray(
                body.id, indices, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(indices), physicsClientId=self.client
            )

    def joint_states(
        self, body: LoadedBody, joints: MovingJoints, indices: Sequence[int]
    ) -> tuple[tuple[Any, ...], ...]:
        """Return the result of PyBullet's `getJointStates`, after mimic joints were set exactly to their law.

        Args:
            body: body with these joints.
            joints: moving joints, in the order of `indices`.
            indices: engine indices of the joints.
        """
        states: tuple[tuple[Any, ...], ...] = pybullet.getJointStates(body.id, indices, self.client)
        if not joints.followers:
            return states
        corrected = list(states)
        for i, leader, multiplier, offset in joints.followers:
            q, dq = multiplier * states[leader][0] + offset, multiplier * states[leader][1]
            if abs(states[i][0] - q) > SLACK or abs(states[i][1] - dq) > SLACK:
                pybullet.resetJointState(body.id, indices[i], q, dq, physicsClientId=self.client)
                corrected[i] = (q, dq, *states[i][2:])
        return tuple(corrected)

    def remove(self, body: LoadedBody) -> None:
        """Remove a body from the world."""
        for gear in body.gears:
            pybullet.removeConstraint(gear, physicsClientId=self.client)
        pybullet.removeBody(body.id, physicsClientId=self.client)

    def pose(self, body: LoadedBody, index: int) -> transforms.FloatArray:
        """Return the pose of a link's frame (not of its centre of mass) in the world, shape (4, 4)."""
        if index < 0:
            position, orientation = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self.client)
            return transforms.homogeneous(
                transforms.rotation_from_quaternion(orientation), position
            ) @ transforms.inverse(self.inertial_frame(body, index))
        state = pybullet.getLinkState(body.id, index, computeForwardKinematics=1, physicsClientId=self.client)
        return transforms.homogeneous(transforms.rotation_from_quaternion(state[5]), state[4])

    def inertial_frame(self, body: LoadedBody, index: int) -> transforms.FloatArray:
        """Return the pose of a link's centre-of-mass frame in the link frame, shape (4, 4)."""
        info = pybullet.getDynamicsInfo(body.id, index, physicsClientId=self.client)
        return transforms.homogeneous(transforms.rotation_from_quaternion(info[4]), info[3])

    def motion(self, body: LoadedBody, index: int) -> tuple[tuple[float, ...], ...]:
        """Return the motion of a link's centre of mass in the world frame.

        Position [m], quaternion (x, y, z, w), linear [m/s] and angular velocity [rad/s].
        """
        if index < 0:
            pose = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self.client)
            return (*pose, *pybullet.getBaseVelocity(body.id, physicsClientId=self.client))
        state = pybullet.getLinkState(
            body.id, index, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self.client
        )
        return state[0], state[1], state[6], state[7]
