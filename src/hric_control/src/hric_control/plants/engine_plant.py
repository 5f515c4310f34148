"""What the plants of all engines do alike: they pass on what concerns modes, joints of models and bushings."""

from collections.abc import Sequence
from typing import Protocol

from hric_control.plant import Articulated, Bushing, BushingLoad, DrivenPlant, Mode
from hric_control.plants.bushings import Bushings
from hric_control.plants.moving_joints import MovingJoints
from hric_core.errors import CommandError


class DrivenRobot(Protocol):
    """The robot of a plant."""

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """What the commands of the actuated joints mean from now on."""

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or free the actuated joints."""


class JointsOfModel(Protocol):
    """The moving joints of one model, `joints`, all of them actuated."""

    joints: MovingJoints

    def read(self, q: list[float], dq: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place [rad or m], [rad/s or m/s]."""

    def drive(self, efforts: Sequence[float]) -> None:
        """From the next step on [N m or N]. Raises CommandError where they are not as many as joints."""


class JointedWorld(Protocol):
    """The models around the robot, and what holds links together."""

    @property
    def bushings(self) -> Bushings:
        """All that are connected."""

    def joints_of(self, model: str) -> JointsOfModel:
        """Of a model beside the robot. Raises UnknownNameError."""

    def put_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Joints of a model at q, dq. Raises UnknownNameError, CommandError."""

    def bind_connected(self) -> None:
        """Others are connected than before."""

    def base_link(self, name: str) -> str:
        """Root link of a model. Raises UnknownNameError."""


class EnginePlant(DrivenPlant, Articulated):
    """A plant with a robot and a world that have the work.

    Attributes:
        robot: the robot.
        world: everything around it.
    """

    robot: DrivenRobot
    world: JointedWorld

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """What `apply` means for each joint: an effort, or the target of a stiff velocity or position drive within the
        URDF's limits."""
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
        """Name of a model's root link."""
        return self.world.base_link(model)

    def model_joints(self, model: str) -> tuple[str, ...]:
        """Names of the moving joints of a model."""
        return tuple(self.world.joints_of(model).joints.names)

    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """State of a model's joints at the measuring instant."""
        self.world.joints_of(model).read(q, dq)

    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put a model's joints at q, dq, now and after each reset."""
        self.world.put_joints(model, q, dq)

    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Efforts in a model's joints from the next step on."""
        self.world.joints_of(model).drive(tau)

    def connect(self, name: str, bushing: Bushing) -> None:
        """Hold two bodies together from the next step on."""
        self.world.bushings.connect(name, bushing)
        self.world.bind_connected()

    def disconnect(self, name: str) -> None:
        """Let go."""
        self.world.bushings.disconnect(name)
        self.world.bind_connected()

    def connections(self) -> list[str]:
        """Names of what is connected."""
        return list(self.world.bushings.laws)

    def bushing_load(self, name: str) -> BushingLoad:
        """What a bushing did in the last step."""
        return self.world.bushings.load(name)
