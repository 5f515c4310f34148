"""A stop of the emulated arm, measured: it moves, the user stop is pressed, and the control box brings it to rest.

The box brakes each joint's desired velocity with its acceleration limit, from the measured one on, and its internal
joint impedance makes the arm follow (`franka_sim.box.hold`, `internal_impedance`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from franka_hw_interface.model import Frame
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, Outcome
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.separation.stopping import Row
from hric_control.plant import Load
from hric_core.errors import HricError
from hric_core.geometry import FloatArray

STANDSTILL = 0.010
"""Slower than that the end effector is at rest [m/s]; chosen by this project."""
QUIET = 0.1
"""So long it has to stay slower [s]."""
LONGEST = 5.0
"""Of a stop [s]."""
LOAD_RADIUS = 0.05
"""The load is a ball of that radius around the end effector [m]."""
POSES = (
    (0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398),  # that of libfranka's examples, and of the thesis
    (0.0, 0.9, 0.0, -0.8, 0.0, 1.7, 0.785398),  # reaches far
)
"""Poses beside the random ones, 7 floats [rad]."""
RANDOM_POSES, SEED, INNER = 6, 0, 0.7
"""How many, of which seed, and in which inner share of the joints' ranges."""
ALONE = 6
"""Joints that also move alone: those before the last, which turns the end effector on the spot."""


@dataclass(frozen=True)
class Begun:
    """Where a stop begins.

    Attributes:
        q, dq: joint position and velocity, shape (7,) [rad], [rad/s].
    """

    q: FloatArray
    dq: FloatArray


@dataclass(frozen=True)
class Stopped:
    """What came of it.

    Attributes:
        time: from the press of the user stop until the end effector is at rest [s].
        distance: that it covers in that time, along its path [m].
    """

    time: float
    distance: float


class Stopping:
    """The arm of a simulation, which is put where a stop begins, at full speed.

    Args:
        robot: it is made, and nobody else steps it.
    """

    def __init__(self, robot: FrankaHWSim) -> None:
        self._robot, self._model, self._box = robot, robot.model, robot.box
        self._dt = robot.plant.time_step
        self._box.report = lambda text: None  # of each press

    def carry(self, mass: float) -> None:
        """A load [kg] at the end effector, of the plant and of what the arm knows.

        Raises:
            HricError: the arm does not take it.
        """
        com = tuple(map(float, self._model.F_T_EE[:3, 3]))
        inertia = tuple((0.4 * mass * LOAD_RADIUS**2 * np.eye(3)).ravel().tolist())
        self._box.reset(self._robot.q_start)
        if self._box.set_load(mass, com, inertia) is not Outcome.SUCCESS:
            raise HricError(f"a load of {mass:g} kg is refused; valid: what set_load takes")
        self._robot.plant.set_load(Load(mass, com, inertia) if mass else None, f"{self._robot.arm_id}_link8")

    def jacobian(self, q: Sequence[float] | FloatArray) -> FloatArray:
        """Of the end effector's position, shape (3, 7) [m/rad]."""
        return np.asarray(self._model.zero_jacobian(Frame.END_EFFECTOR, q)[:3])

    def stop(self, begun: Begun) -> Stopped:
        """One stop.

        Raises:
            HricError: the arm does not come to rest.
        """
        box, robot, dt = self._box, self._robot, self._dt
        robot.plant.reset(begun.q.tolist(), begun.dq.tolist())
        box.reset(begun.q.tolist())
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
        raise HricError(f"the arm does not come to rest within {LONGEST:g} s from q {begun.q.round(3).tolist()} rad")

    def _speed(self) -> float:
        states = self._robot.states
        return float(np.linalg.norm(self.jacobian(states.position) @ np.array(states.velocity)))

    def begins(self, q: FloatArray, speed: float, max_velocity: Sequence[float]) -> Iterator[Begun]:
        """Motions of the end effector at a speed [m/s] in a pose that the joints' velocity limits allow: along the axes
        of the base with the smallest joint velocities, and each joint alone; all in both senses."""
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
                    yield Begun(q, scaled)


def _quiet(speeds: Sequence[float], dt: float) -> bool:
    count = round(QUIET / dt)
    return len(speeds) > count and max(speeds[-count:]) < STANDSTILL


def standing(speed: FloatArray, dt: float) -> Stopped:
    """Of the speed over a stop.

    Args:
        speed: of the end effector from the begin on, shape (n,), slower than STANDSTILL at its end [m/s].
        dt: time between two samples [s].
    """
    last = int(np.flatnonzero(speed >= STANDSTILL)[-1]) if np.any(speed >= STANDSTILL) else 0
    a, b = float(speed[last]), float(speed[last + 1])
    share = (a - STANDSTILL) / (a - b) if a > STANDSTILL else 0.0
    whole = float(np.sum(0.5 * (speed[:last] + speed[1 : last + 1]))) * dt
    return Stopped((last + share) * dt, whole + 0.5 * (a + STANDSTILL) * share * dt)


def poses(lower: Sequence[float], upper: Sequence[float]) -> list[FloatArray]:
    """POSES, and random ones between the joints' limits [rad]; shape (7,) each."""
    low, high = np.array(lower), np.array(upper)
    middle, half = 0.5 * (low + high), 0.5 * INNER * (high - low)
    drawn = np.random.default_rng(SEED).uniform(middle - half, middle + half, (RANDOM_POSES, 7))
    return [*map(np.array, POSES), *drawn]


def worst(
    stopping: Stopping, starts: Sequence[FloatArray], speed: float, load: float, max_velocity: Sequence[float]
) -> Row | None:
    """Longest time and longest distance of all stops from a speed [m/s] with a load [kg] that it carries already; None:
    no pose reaches that speed."""
    found = [stopping.stop(begun) for q in starts for begun in stopping.begins(q, speed, max_velocity)]
    if not found:
        return None
    return Row(speed, load, max(one.time for one in found), max(one.distance for one in found))
