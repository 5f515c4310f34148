"""Measurement of a stop of the emulated arm: it moves, the user stop is pressed, and the control box brakes it.

The box brakes each joint's desired velocity with its acceleration limit, starting at the measured one, and its internal
joint impedance makes the arm follow (`franka_sim.box.hold`, `internal_impedance`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from franka_hw_interface.model import FrankaFrame
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, RequestOutcome
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.separation.stopping import StopRow
from hric_control.plant import Load
from hric_core.errors import HricError
from hric_core.geometry import FloatArray

STANDSTILL = 0.010
"""Speed below which the end effector is at rest [m/s]; chosen by this project."""
QUIET = 0.1
"""Time for which it must stay below that speed [s]."""
LONGEST = 5.0
"""Maximum duration of a stop [s]."""
LOAD_RADIUS = 0.05
"""Radius of the load, a ball around the end effector [m]."""
POSES = (
    (0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398),  # start pose of libfranka's examples and of the thesis
    (0.0, 0.9, 0.0, -0.8, 0.0, 1.7, 0.785398),  # reaches far
)
"""Fixed poses, used in addition to the random ones, 7 floats [rad]."""
RANDOM_POSES, SEED, INNER = 6, 0, 0.7
"""Number of random poses, their seed, and the inner share of the joint ranges from which they are drawn [1]."""
ALONE = 6
"""Number of joints that also move alone: all but the last, which only rotates the end effector."""


@dataclass(frozen=True)
class StopStart:
    """State at the start of a stop.

    Attributes:
        q, dq: joint position and velocity, shape (7,) [rad], [rad/s].
    """

    q: FloatArray
    dq: FloatArray


@dataclass(frozen=True)
class StopResult:
    """Result of a stop.

    Attributes:
        time: time from the user stop until the end effector is at rest [s].
        distance: path length of the end effector in that time [m].
    """

    time: float
    distance: float


class StoppedArm:
    """Simulated arm that is set in motion at a given state and then stopped by the user stop.

    Args:
        robot: simulated robot; nothing else may step it.
    """

    def __init__(self, robot: FrankaHWSim) -> None:
        self._robot, self._model, self._box = robot, robot.model, robot.box
        self._dt = robot.plant.time_step
        self._box.report = lambda text: None  # do not report each user stop

    def carry(self, mass: float) -> None:
        """Attach a load [kg] to the end effector, in the plant and in the load parameters of the arm.

        Raises:
            HricError: the arm refuses the load.
        """
        com = tuple(map(float, self._model.F_T_EE[:3, 3]))
        inertia = tuple((0.4 * mass * LOAD_RADIUS**2 * np.eye(3)).ravel().tolist())
        self._box.reset(self._robot.q_start)
        if self._box.set_load(mass, com, inertia) is not RequestOutcome.SUCCESS:
            raise HricError(f"a load of {mass:g} kg is refused; valid: loads that set_load accepts")
        self._robot.plant.set_load(Load(mass, com, inertia) if mass else None, f"{self._robot.arm_id}_link8")

    def jacobian(self, q: Sequence[float] | FloatArray) -> FloatArray:
        """Return the Jacobian of the end effector's position, shape (3, 7) [m/rad]."""
        return np.asarray(self._model.zero_jacobian(FrankaFrame.END_EFFECTOR, q)[:3])

    def stop(self, start: StopStart) -> StopResult:
        """Execute and measure one stop.

        Raises:
            HricError: the arm does not come to rest.
        """
        box, robot, dt = self._box, self._robot, self._dt
        robot.plant.reset(start.q.tolist(), start.dq.tolist())
        box.reset(start.q.tolist())
        robot.read(0.0, dt)
        box.move(MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE))
        box.set_user_stop(True)
        speeds = [self._speed()]
        for cycle in range(1, round(LONGEST / dt)):
            robot.plant.apply(box.write(None))
            robot.plant.step()
            robot.read(cycle * dt, dt)
            speeds.append(self._speed())
            if _quiet(speeds, dt):
                return standing(np.array(speeds), dt)
        raise HricError(f"the arm does not come to rest within {LONGEST:g} s from q {start.q.round(3).tolist()} rad")

    def _speed(self) -> float:
        states = self._robot.states
        return float(np.linalg.norm(self.jacobian(states.position) @ np.array(states.velocity)))

    def begins(self, q: FloatArray, speed: float, max_velocity: Sequence[float]) -> Iterator[StopStart]:
        """Yield start states in pose q with an end-effector speed [m/s], within the joints' velocity limits.

        The directions are the axes of the base, with the smallest joint velocities, and the motion of each joint alone,
        in both senses.
        """
        J = self.jacobian(q)
        along = np.linalg.pinv(J).T
        alone = np.eye(7)[:ALONE]
        for dq in (*along, *alone):
            there = float(np.linalg.norm(J @ dq))
            if there < 1e-6:
                continue
            for sense in (1.0, -1.0):
                scaled = dq * (sense * speed / there)
                if np.all(np.abs(scaled) <= max_velocity):
                    yield StopStart(q, scaled)


def _quiet(speeds: Sequence[float], dt: float) -> bool:
    count = round(QUIET / dt)
    return len(speeds) > count and max(speeds[-count:]) < STANDSTILL


def standing(speed: FloatArray, dt: float) -> StopResult:
    """Return time and distance of a stop from the speed of the end effector.

    Args:
        speed: speed of the end effector from the start of the stop, below STANDSTILL at the end, shape (n,) [m/s].
        dt: time between two samples [s].
    """
    last = int(np.flatnonzero(speed >= STANDSTILL)[-1]) if np.any(speed >= STANDSTILL) else 0
    a, b = float(speed[last]), float(speed[last + 1])
    share = (a - STANDSTILL) / (a - b) if a > STANDSTILL else 0.0
    distance = float(np.sum(0.5 * (speed[:last] + speed[1 : last + 1]))) * dt
    return StopResult((last + share) * dt, distance + 0.5 * (a + STANDSTILL) * share * dt)


def poses(lower: Sequence[float], upper: Sequence[float]) -> list[FloatArray]:
    """Return POSES and random poses within the joint limits, shape (7,) each [rad]."""
    low, high = np.array(lower), np.array(upper)
    middle, half = 0.5 * (low + high), 0.5 * INNER * (high - low)
    drawn = np.random.default_rng(SEED).uniform(middle - half, middle + half, (RANDOM_POSES, 7))
    return [*map(np.array, POSES), *drawn]


def worst(
    stopping: StoppedArm, starts: Sequence[FloatArray], speed: float, load: float, max_velocity: Sequence[float]
) -> StopRow | None:
    """Return the longest time and distance of all stops from a speed [m/s] with a load [kg] that is attached already.

    None: no pose reaches that speed.
    """
    stops = [stopping.stop(start) for q in starts for start in stopping.begins(q, speed, max_velocity)]
    if not stops:
        return None
    return StopRow(speed, load, max(stop.time for stop in stops), max(stop.distance for stop in stops))
