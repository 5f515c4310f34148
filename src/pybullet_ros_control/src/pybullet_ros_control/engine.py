"""One PyBullet client with every setting that the plant relies on, and the loading of prepared models into it."""

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet

from hric_control.errors import HricError, UnknownNameError
from hric_control.geometry import transforms
from pybullet_ros_control.urdf_model import EngineModel

_MAX_JOINT_VELOCITY = 1e6
"""The engine cuts joint velocities at 100 rad/s by default [rad/s]."""


@dataclass
class Body:
    """A loaded model.

    Attributes:
        name: of the model.
        id: the engine's number of it.
        model: what was loaded; None for a plain shape.
        links: engine index by link name; the base is -1.
        joints: engine index by name of the moving joints.
        parents: engine index of each link's parent, the base left out.
    """

    name: str
    id: int
    model: EngineModel | None
    links: dict[str, int]
    joints: dict[str, int]
    parents: dict[int, int]

    def __post_init__(self) -> None:
        self.link_names = {index: name for name, index in self.links.items()}

    def frame(self, link: str) -> tuple[int, transforms.FloatArray]:
        """(engine link index, T_body_frame shape (4, 4)) of a link of the description.

        Raises:
            UnknownNameError: no such link.
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
    """Where a body is, as the engine has it: the base by its centre of mass, quaternion (x, y, z, w); (q, dq) of each
    joint."""

    position: tuple[float, ...]
    orientation: tuple[float, ...]
    linear: tuple[float, ...]
    angular: tuple[float, ...]
    joints: dict[str, tuple[float, float]]


def _check_display() -> None:
    """The engine ends the whole process when there is no display: look first."""
    display = os.environ.get("DISPLAY", "")
    local = display.removeprefix("unix").partition(":")
    socket = Path("/tmp/.X11-unix") / f"X{local[2].split('.')[0]}"
    if not display or (local[0] == "" and not socket.exists()):
        raise HricError(
            f"gui: true needs a display; DISPLAY is {display!r}. Give gui: false, or start a display (for example Xvfb)"
        )


class Engine:
    """A physics client of its own: several may live in one process without seeing each other."""

    def __init__(self, gui: bool, time_step: float, gravity: Sequence[float]) -> None:
        self.time_step, self.gravity, self.gui = time_step, tuple(gravity), gui
        if gui:
            _check_display()
        self.client: int = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        if self.client < 0:
            raise HricError("PyBullet refused to connect" + (" (one window per process)" if gui else ""))
        self.settings()

    def settings(self) -> None:
        """Forget all bodies and set the world up again."""
        client = self.client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setGravity(*self.gravity, physicsClientId=client)
        pybullet.setTimeStep(self.time_step, physicsClientId=client)
        # No sub-steps: with them the engine's contact forces come out too small by their number.
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
    ) -> Body:
        """Load a prepared model with its root link at T_world_root, shape (4, 4).

        Raises:
            HricError: the engine refuses it.
        """
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE | (pybullet.URDF_USE_SELF_COLLISION if self_collision else 0)
        T = T_world_root @ model.T_root_base
        pose = T[:3, 3].tolist(), transforms.quaternion_from_rotation(T[:3, :3])
        # Not kept for the engine's life: a process that is killed would leave it behind.
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
        return body

    def _index(self, name: str, body_id: int, model: EngineModel) -> Body:
        links, joints, parents = {model.base: -1}, {}, {}
        for index in range(pybullet.getNumJoints(body_id, physicsClientId=self.client)):
            info = pybullet.getJointInfo(body_id, index, physicsClientId=self.client)
            links[info[12].decode()] = index
            parents[index] = info[16]
            if info[2] != pybullet.JOINT_FIXED:
                joints[info[1].decode()] = index
        return Body(name, body_id, model, links, joints, parents)

    def _set_dynamics(self, body: Body) -> None:
        """The engine's hidden dampings off, its speed limit up, and the true principal moments, which it may have
        replaced."""
        assert body.model is not None
        for link, index in body.links.items():
            dampings = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": 0.0}
            pybullet.changeDynamics(
                body.id, index, maxJointVelocity=_MAX_JOINT_VELOCITY, physicsClientId=self.client, **dampings
            )
            moments = body.model.moments.get(link)
            if moments is None:
                continue
            # In a call of its own: together with the settings above the engine ignores it.
            pybullet.changeDynamics(body.id, index, localInertiaDiagonal=moments, physicsClientId=self.client)
            info = pybullet.getDynamicsInfo(body.id, index, physicsClientId=self.client)
            if info[0] != body.model.bodies[link].mass or tuple(info[2]) != moments:
                raise HricError(
                    f"PyBullet did not take the mass of {body.name}::{link}: it has {info[0]} kg, {info[2]} kg m^2"
                )

    def state(self, body: Body) -> BodyState:
        """Where a body is and how it moves."""
        position, orientation = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self.client)
        linear, angular = pybullet.getBaseVelocity(body.id, physicsClientId=self.client)
        joints = {
            name: pybullet.getJointState(body.id, i, physicsClientId=self.client)[:2] for name, i in body.joints.items()
        }
        return BodyState(position, orientation, linear, angular, joints)

    def set_state(self, body: Body, state: BodyState) -> None:
        """Put a body where another one of the same model was."""
        pybullet.resetBasePositionAndOrientation(
            body.id, state.position, state.orientation, physicsClientId=self.client
        )
        pybullet.resetBaseVelocity(body.id, state.linear, state.angular, physicsClientId=self.client)
        for name, (q, dq) in state.joints.items():
            pybullet.resetJointState(body.id, body.joints[name], q, dq, physicsClientId=self.client)

    def motors_off(self, body: Body) -> None:
        """The engine starts every joint with a motor that holds it; take the force out."""
        indices = list(body.joints.values())
        if indices:
            pybullet.setJointMotorControlArray(
                body.id, indices, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(indices), physicsClientId=self.client
            )

    def remove(self, body: Body) -> None:
        """Take a body out of the world."""
        pybullet.removeBody(body.id, physicsClientId=self.client)

    def pose(self, body: Body, index: int) -> transforms.FloatArray:
        """T_world_link of an engine link's frame (not of its centre of mass), shape (4, 4)."""
        if index < 0:
            position, orientation = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self.client)
            return transforms.homogeneous(
                transforms.rotation_from_quaternion(orientation), position
            ) @ transforms.inverse(self.inertial_frame(body, index))
        state = pybullet.getLinkState(body.id, index, computeForwardKinematics=1, physicsClientId=self.client)
        return transforms.homogeneous(transforms.rotation_from_quaternion(state[5]), state[4])

    def inertial_frame(self, body: Body, index: int) -> transforms.FloatArray:
        """T_link_inertial of an engine link, shape (4, 4): the engine has a base's pose by its centre of mass."""
        info = pybullet.getDynamicsInfo(body.id, index, physicsClientId=self.client)
        return transforms.homogeneous(transforms.rotation_from_quaternion(info[4]), info[3])

    def motion(self, body: Body, index: int) -> tuple[tuple[float, ...], ...]:
        """(position [m], quaternion (x, y, z, w), linear [m/s] and angular velocity [rad/s]) of a link's centre of
        mass, world frame."""
        if index < 0:
            pose = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self.client)
            return (*pose, *pybullet.getBaseVelocity(body.id, physicsClientId=self.client))
        state = pybullet.getLinkState(
            body.id, index, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self.client
        )
        return state[0], state[1], state[6], state[7]
