"""Common part of the plants of all engines: modes, joints of models and bushings are passed to robot and world."""

from collections.abc import Sequence
from typing import Protocol

from hric_control.plant import Articulated, Bushing, BushingLoad, DrivenPlant, Mode
from hric_control.plants.bushings import Bushings
from hric_control.plants.moving_joints import MovingJoints
from hric_core.errors import CommandError


class DrivenRobot(Protocol):
    """Robot of a plant."""

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set the meaning of the actuated joints' commands from now on."""

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or free the actuated joints."""


class JointsOfModel(Protocol):
    """Moving joints of one model, `joints`, all of them actuated."""

    joints: MovingJoints

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place [rad or m], [rad/s or m/s]."""

    def drive(self, efforts: Sequence[float]) -> None:
        """Set efforts from the next step on [N m or N]. Raises CommandError if there is not one per joint."""


class JointedWorld(Protocol):
    """Models around the robot, and the bushings between links."""

    @property
    def bushings(self) -> Bushings:
        """Active bushings."""

    def joints_of(self, model: str) -> JointsOfModel:
        """Return the joints of a spawned model. Raises UnknownNameError."""

    def put_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Put the joints of a model at q, dq. Raises UnknownNameError, CommandError."""

    def bind_connected(self) -> None:
        """Update the engine after a change of connections."""

    def base_link(self, name: str) -> str:
        """Return the root link of a model. Raises UnknownNameError."""


class EnginePlant(DrivenPlant, Articulated):
    """Plant that delegates to a robot and a world.

    Attributes:
        robot: the robot.
        world: everything around it.
    """

    robot: DrivenRobot
    world: JointedWorld

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set each joint's command mode: effort, or target of a stiff velocity or position drive within URDF limits."""
        self._check_length(modes, "modes")
        self.robot.set_modes(modes)

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or free each joint."""
        self._check_length(on, "brakes")
        self.robot.set_brakes(on)

    def _check_length(self, values: Sequence[object], what: str) -> None:
        if len(values) != len(self.joint_names):
            raise CommandError(
                f"{what}: got {len(values)} values for {len(self.joint_names)} joints ({', '.join(self.joint_names)})"
            )

    def base_link(self, model: str) -> str:
        """Return the name of a model's root link."""
        return self.world.base_link(model)

    def model_joints(self, model: str) -> tuple[str, ...]:
        """Return the names of a model's moving joints."""
        return tuple(self.world.joints_of(model).joints.names)

    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """Write the state of a model's joints at the measuring instant into the lists in place."""
        self.world.joints_of(model).read(q, dq)

    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put a model's joints at q, dq, now and after each reset."""
        self.world.put_joints(model, q, dq)

    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Set efforts of a model's joints from the next step on."""
        self.world.joints_of(model).drive(tau)

    def connect(self, name: str, bushing: Bushing) -> None:
        """Connect two bodies from the next step on."""
        self.world.bushings.connect(name, bushing)
        self.world.bind_connected()

    def disconnect(self, name: str) -> None:
        """Remove a connection."""
        self.world.bushings.disconnect(name)
        self.world.bind_connected()

    def connections(self) -> list[str]:
        """Return the names of the connections."""
        return list(self.world.bushings.laws)

    def bushing_load(self, name: str) -> BushingLoad:
        """Return the load of a bushing in the last step."""
        return self.world.bushings.load(name)
