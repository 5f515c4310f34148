"""Measurement of a stop: the emulated arm moves, its user stop is pressed, and its control box brakes it.

The control box reduces the desired velocity of each joint, from the measured velocity on, with the acceleration limit;
its internal joint impedance makes the arm follow (`franka_sim.box.hold`, `internal_impedance`).
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
"""Speed below which the end effector counts as at rest [m/s]; project default."""
QUIET = 0.1
"""Time for which the end effector must be slower than STANDSTILL to count as at rest [s]."""
LONGEST = 5.0
"""Maximum duration of a stop [s]."""
LOAD_RADIUS = 0.05
"""Radius of the load, a ball around the end effector [m]."""
POSES = (
    (0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398),  # start pose of libfranka's examples and of the thesis
    (0.0, 0.9, 0.0, -0.8, 0.0, 1.7, 0.785398),  # arm stretched forward
)
"""Fixed arm postures, used in addition to the random ones: joint positions, 7 floats each [rad]."""
RANDOM_POSES, SEED, INNER = 6, 0, 0.7
"""Number of random postures, their seed, and the central share of each joint's range from which they are drawn."""
ALONE = 6
"""Number of joints for which a motion of this joint alone is measured: all but the last, which only rotates the end
effector."""


@dataclass(frozen=True)
class StopStart:
    """Joint state of the arm at the instant when the user stop is pressed.

    Attributes:
        q, dq: joint position and velocity, shape (7,) [rad], [rad/s].
    """

    q: FloatArray
    dq: FloatArray


@dataclass(frozen=True)
class StopResult:
    """Stopping time and stopping distance of one stop.

    Attributes:
        time: time from the user stop until the end effector is at rest [s].
        distance: length of the end effector's path in this time [m].
    """

    time: float
    distance: float


class StoppedArm:
    """Simulated arm that starts with a given joint position and velocity and is stopped by its user stop.

    Args:
        robot: simulated robot; nothing else may step it.
    """

    def __init__(self, robot: FrankaHWSim) -> None:
        self._robot, self._model, self._box = robot, robot.model, robot.box
        self._dt = robot.plant.time_step
        self._box.report = lambda text: None  # do not report each user stop

    def carry(self, mass: float) -> None:
        """Attach a load [kg] to the end effector, physically and in the load parameters of the control box.

        Raises:
            HricError: the control box rejects the load.
        """
        com = tuple(map(float, self._model.F_T_EE[:3, 3]))
        inertia = tuple((0.4 * mass * LOAD_RADIUS**2 * np.eye(3)).ravel().tolist())
        self._box.reset(self._robot.q_start)
        if self._box.set_load(mass, com, inertia) is not RequestOutcome.SUCCESS:
            raise HricError(f"the control box rejects a load of {mass:g} kg; valid: a load within the arm's payload")
        self._robot.plant.set_load(Load(mass, com, inertia) if mass else None, f"{self._robot.arm_id}_link8")

    def jacobian(self, q: Sequence[float] | FloatArray) -> FloatArray:
        """Return the Jacobian of the end effector's position, shape (3, 7) [m/rad]."""
        return np.asarray(self._model.zero_jacobian(FrankaFrame.END_EFFECTOR, q)[:3])

    def stop(self, start: StopStart) -> StopResult:
        """Simulate one stop and measure it.

        Raises:
            HricError: the arm does not come to rest within LONGEST.
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
        """Yield start states in posture q with an end-effector speed [m/s], within the joint velocity limits.

        The motions are those along the base axes, with the smallest joint velocities, and those of each joint alone,
        all in both directions.
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
    """Return stopping time and distance, computed from the speed of the end effector over time.

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
    """Return the maximum time and distance over all stops from a speed [m/s]; `load`: mass that is attached [kg].

    None: in no posture the arm can reach this speed.
    """
    stops = [stopping.stop(start) for q in starts for start in stopping.begins(q, speed, max_velocity)]
    if not stops:
        return None
    return StopRow(speed, load, max(stop.time for stop in stops), max(stop.distance for stop in stops))
