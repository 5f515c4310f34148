"""One plant that several simulated robots share: each robot sees a plant with the joints that are its own."""

from collections.abc import Mapping, Sequence

from hric_control.plant import Contact, DrivenPlant, FloatArray, Load, Mode, Plant, Surface
from hric_core.errors import HricError


class SharedPlant:
    """Plant of several robots, with the state and the commands of all joints in the order of the plant.

    Args:
        plant: plant with all joints of all robots.

    Attributes:
        plant: as in Args.
        position, velocity, effort: joint states that `read` has read last [rad or m], [rad/s or m/s], [N m or N].
        command: commands for the next step.
        modes, brakes: command mode of each joint, and True for a locked brake.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        n = len(plant.joint_names)
        self.position, self.velocity, self.effort, self.command = [0.0] * n, [0.0] * n, [0.0] * n, [0.0] * n
        self.modes, self.brakes = [Mode.EFFORT] * n, [False] * n

    def part(self, joint_names: Sequence[str]) -> "PlantPart":
        """Return the plant of one robot, whose joints follow each other in the shared plant."""
        return PlantPart(self, joint_names)

    def read(self) -> None:
        """Read the state of all joints from the plant; once per cycle, before the robots read theirs."""
        self.plant.read_state(self.position, self.velocity, self.effort)


class PlantPart(DrivenPlant):
    """Plant of one of several robots: vectors have the robot's own joints, everything else is that of the shared plant.

    The robots' common owner steps the plant and sets the positions of all joints in it; so `step` is refused here, and
    `reset` and `set_configuration` only change the state that the robot reads.

    Args:
        shared: the shared plant.
        joint_names: joints of the robot.
    """

    def __init__(self, shared: SharedPlant, joint_names: Sequence[str]) -> None:
        self._shared, self._plant = shared, shared.plant
        self.joint_names = tuple(joint_names)
        first = self._plant.joint_names.index(self.joint_names[0])
        self._span = slice(first, first + len(self.joint_names))
        if self._plant.joint_names[self._span] != self.joint_names:
            raise HricError(f"the joints {', '.join(joint_names)} are not successive joints of the shared plant")
        self.time_step, self.integrator = self._plant.time_step, self._plant.integrator
        self.gravity = self._plant.gravity

    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Set the state that `read_state` returns until the shared plant is read again."""
        zeros = [0.0] * len(self.joint_names)
        shared, span = self._shared, self._span
        shared.position[span], shared.velocity[span], shared.effort[span] = q, zeros if dq is None else dq, zeros

    def set_configuration(self, q: Sequence[float]) -> None:
        """Set the state that `read_state` returns until the shared plant is read again, at rest."""
        self.reset(q)

    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Write the joint state that the shared plant has read last into the lists, in place."""
        shared, span = self._shared, self._span
        q[:], dq[:], tau[:] = shared.position[span], shared.velocity[span], shared.effort[span]

    def motor_effort(self) -> list[float]:
        """Return the motor efforts of the robot's joints in the last step [N m or N]."""
        return self._plant.motor_effort()[self._span]

    def engine_state(self) -> tuple[list[float], list[float]]:
        """Return positions and velocities of the robot's joints as the engine has them."""
        q, dq = self._plant.engine_state()
        return q[self._span], dq[self._span]

    def apply(self, tau: Sequence[float]) -> None:
        """Set the commands of the robot's joints for the next step."""
        self._shared.command[self._span] = tau

    def step(self) -> None:
        """Refuse to step: the owner of the shared plant steps it once for all robots."""
        raise HricError("a plant that several robots share is stepped by their common loop")

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set the command modes of the robot's joints."""
        if not isinstance(self._plant, DrivenPlant):
            raise HricError(f"{type(self._plant).__name__} has no velocity or position drives")
        self._shared.modes[self._span] = modes
        self._plant.set_modes(self._shared.modes)

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or release the brakes of the robot's joints."""
        self._shared.brakes[self._span] = on
        self._plant.set_brakes(self._shared.brakes)

    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Replace the payload of a link of the shared plant; the link must be named."""
        if link is None:
            raise HricError("the link of a payload must be named in a plant that several robots share")
        self._plant.set_load(load, link)

    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Apply a wrench to a body of the shared plant."""
        self._plant.apply_wrench(body, force, torque, point, duration)

    def clear_wrenches(self, body: str | None = None) -> None:
        """Remove the applied wrenches on one body of the shared plant, or on all bodies."""
        self._plant.clear_wrenches(body)

    def contacts(self) -> list[Contact]:
        """Return all contacts of the shared plant in the last step."""
        return self._plant.contacts()

    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        self._plant.spawn(name, urdf_xml, T_world_model, fixed=fixed, surfaces=surfaces)

    def delete(self, name: str) -> None:
        """Remove a model of the shared plant."""
        self._plant.delete(name)

    def model_names(self) -> list[str]:
        """Return the names of the models in the shared plant."""
        return self._plant.model_names()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return pose and twist of a body of the shared plant."""
        return self._plant.link_state(body)

    def mass_matrix(self) -> FloatArray:
        """Return the mass matrix of the robot's joints, shape (n, n) [kg m^2]."""
        return self._plant.mass_matrix()[self._span, self._span]
