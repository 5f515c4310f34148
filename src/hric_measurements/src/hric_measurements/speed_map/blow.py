"""Simulated impacts of an arm's end effector on a force measuring device."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum

import numpy as np

from franka_hw_interface.model import FrankaFrame
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.contact.limits import TRANSIENT_TIME
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_measurements.speed_map.device import HitBody, MeasuringDevice
from hric_run.definition import experiment
from hric_run.simulation import Simulation

STIFFNESS, DAMPING = 100.0, 20.0
"""Position and velocity gain of each joint of a driven arm, as in the experiment `contact` [N m/rad], [N m s/rad]."""
SHARE = 0.9
"""Maximum share of the arm's speed limit that is used [1], since the impact itself accelerates some joints."""


class ArmBehaviour(Enum):
    """Behaviour of the arm during the contact.

    PASSIVE: gravity compensation only, as the closed-form limit speed assumes.
    DRIVEN: PD control continues the motion of the joints, through the control box with its limits and reflexes.
    """

    PASSIVE = "passive"
    DRIVEN = "driven"


@dataclass(frozen=True)
class ImpactApproach:
    """Straight motion of the end effector before an impact.

    Attributes:
        q: joint position at the contact, shape (7,) [rad].
        direction: direction of motion, unit vector in the base frame, shape (3,).
        dq: joint velocity for 1 m/s along the direction without rotation, shape (7,) [rad/m].
        mass: reflected (effective) mass of the arm along the direction, including rotors [kg].
        fastest: maximum speed along the direction that the joint velocity limits allow [m/s].
    """

    q: FloatArray
    direction: FloatArray
    dq: FloatArray
    mass: float
    fastest: float


@contextmanager
def simulated_arm(overrides: Sequence[str]) -> Iterator[FrankaHWSim]:
    """Simulate an arm with its emulated control box, by default in MuJoCo.

    overrides: overrides of the experiment's values, `key:=value`.

    Raises:
        HricError: an override is wrong, or it selects a robot without an emulated control box.
    """
    definition = experiment.load(experiment.NONE, ["simulator:=mujoco", *overrides])
    with Simulation(definition) as simulation:
        robot = simulation.app.hw
        if not isinstance(robot, FrankaHWSim):
            raise HricError(f"{type(robot).__name__} has no emulated control box; valid: franka_sim/FrankaHWSim")
        yield robot


class Blows:
    """Simulator of impacts of one arm on a measuring device.

    Args:
        robot: simulated robot; nothing else may step the simulation.
        arm: behaviour of the arm during the contact.
    """

    def __init__(self, robot: FrankaHWSim, arm: ArmBehaviour) -> None:
        self._robot, self._arm = robot, arm
        self._link = f"{robot.arm_id}_link8"
        self._point = robot.model.F_T_EE[:3, 3].tolist()
        self._rotors = np.diag(robot.box.config.rotor_inertia)
        robot.box.report = lambda text: None  # reflexes are part of what is measured

    def approach(self, q: FloatArray, direction: FloatArray) -> ImpactApproach:
        """Return the approach along `direction`, shape (3,); `q`: joint position at the contact, shape (7,) [rad]."""
        model = self._robot.model
        J = model.zero_jacobian(FrankaFrame.END_EFFECTOR, q)
        dq = np.linalg.pinv(J) @ np.array([*direction, 0.0, 0.0, 0.0])
        row = direction @ J[:3]
        mass = 1.0 / float(row @ np.linalg.solve(model.mass(q) + self._rotors, row))
        allowed = np.array(self._robot.box.config.limits.velocity) / np.maximum(np.abs(dq), 1e-9)
        return ImpactApproach(q, direction, dq, mass, float(allowed.min()))

    def peak(self, approach: ImpactApproach, body: HitBody, speed: float) -> float:
        """Return the device's peak force within the duration of a transient contact [N]; arguments: see `measured`."""
        return self.measured(approach, body, speed, TRANSIENT_TIME).peak

    def measured(self, approach: ImpactApproach, body: HitBody, speed: float, duration: float) -> MeasuringDevice:
        """Simulate an impact until both have separated; return the device with its readings.

        Args:
            approach: motion of the arm.
            body: spring and mass of the device, which represent a body region.
            speed: closing speed [m/s]; if the arm cannot reach it, the body moves towards the arm at the difference.
            duration: longest time that is simulated [s].
        """
        robot, dt, arm_speed = self._robot, self._robot.plant.time_step, min(speed, SHARE * approach.fastest)
        dq = arm_speed * approach.dq
        robot.plant.reset(approach.q.tolist(), dq.tolist())
        robot.box.reset(approach.q.tolist())
        robot.read(0.0, dt)
        if self._arm is ArmBehaviour.DRIVEN:
            robot.box.move(MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE))
        device = MeasuringDevice(body, approach.mass, dt, speed - arm_speed)
        begin = float(approach.direction @ self._position(approach.q))
        for cycle in range(1, round(duration / dt)):
            q, v = (np.array(part) for part in robot.plant.engine_state())
            along = approach.direction @ robot.model.zero_jacobian(FrankaFrame.END_EFFECTOR, q)[:3]
            force = device.push(float(approach.direction @ self._position(q)) - begin, float(along @ v))
            if device.apart:
                break
            robot.plant.apply_wrench(self._link, (-force * approach.direction).tolist(), (0.0,) * 3, self._point, dt)
            robot.plant.apply(self._torque(approach.q + (cycle - 1) * dt * dq - q, dq - v, q, v))
            robot.plant.step()
            robot.read(cycle * dt, dt)
        return device

    def _position(self, q: FloatArray) -> FloatArray:
        """Return the position of the end effector in the base frame, shape (3,) [m]."""
        return np.asarray(self._robot.model.pose(FrankaFrame.END_EFFECTOR, q)[:3, 3])

    def _torque(self, behind: FloatArray, slower: FloatArray, q: FloatArray, v: FloatArray) -> list[float]:
        """Return the joint torques for the simulated arm, shape (7,) [N m].

        Args:
            behind: desired minus measured joint position, shape (7,) [rad].
            slower: desired minus measured joint velocity, shape (7,) [rad/s].
            q: measured joint position, shape (7,) [rad].
            v: measured joint velocity, shape (7,) [rad/s].
        """
        robot = self._robot
        if self._arm is ArmBehaviour.PASSIVE:
            weight: list[float] = robot.model.gravity_list(q.tolist())
            return weight
        command = MotionCommand()
        command.tau = (STIFFNESS * behind + DAMPING * slower + robot.model.coriolis(q, v)).tolist()
        return robot.box.write(command)
