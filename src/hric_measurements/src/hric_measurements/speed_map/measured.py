"""Measurement of a speed map: limit speed at each point in each direction, from impacts and from the closed form."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.contact.limits import ContactLimit, Limits
from hric_assessment.contact.mass import Mechanism, RobotMasses
from hric_assessment.contact.speed import permitted_regions, speed_limit
from hric_core import urdf
from hric_core.errors import FailureError, HricError
from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import inverse
from hric_human.body.regions import REGION_MODELS
from hric_measurements.speed_map.blow import ArmBehaviour, Blows
from hric_measurements.speed_map.device import HitBody
from hric_measurements.speed_map.grid import DIRECTIONS, Postures

CLOSE, TRIES = 0.005, 20
"""Relative tolerance of the force at the limit speed [1], and maximum number of impacts in the search for it."""


@dataclass(frozen=True)
class MapCell:
    """Limit speeds at one point in one direction.

    Attributes:
        point: position of the end effector in the base frame, shape (3,) [m].
        direction: direction of motion, such as "+x" of the base frame.
        mass: reflected mass of the arm [kg].
        speed: limit of the closing speed, measured with the virtual device [m/s].
        fastest: speed that the arm's joints allow along this direction without rotation of the hand [m/s].
        closed_form: limit speed computed with the reflected mass [m/s].
        standard: limit speed computed with the effective mass M/2 + m_L of ISO/TS 15066 [m/s].
        locked: limit speed computed with the mass with locked joints [m/s].
        locked_mass: mass of the arm with locked joints [kg].
    """

    point: FloatArray
    direction: str
    mass: float
    speed: float
    fastest: float
    closed_form: float
    standard: float
    locked: float
    locked_mass: float


@dataclass(frozen=True)
class MapRequest:
    """Settings of a speed map.

    Attributes:
        region: body region that the arm hits.
        limits: contact limits of all body regions.
        damping: damping of the device [N s/m].
        arm: behaviour of the arm during the contact.
    """

    region: str
    limits: Limits
    damping: float
    arm: ArmBehaviour

    @property
    def limit(self) -> ContactLimit:
        """Contact limit of the region."""
        limit = self.limits.at((self.region,))
        assert limit is not None, "`check` refuses a region without one"
        return limit

    def check(self) -> float:
        """Return the region's force limit for transient contacts [N].

        Raises:
            HricError: no contact with the region is permitted, or the table of limits has no such region.
        """
        force = speed_limit(self.limits, self.region, 1.0).force_transient
        if force is None:
            raise HricError(
                f"{self.limits.table.title} permits no contact with {self.region} at any speed; valid: "
                f"{'; '.join(permitted_regions(self.limits))}"
            )
        return force


def measure(robot: FrankaHWSim, request: MapRequest, points: FloatArray) -> Iterator[tuple[FloatArray, list[MapCell]]]:
    """Measure the limit speeds at points of the workspace.

    Args:
        robot: simulated robot.
        request: settings of the map.
        points: points in the base frame, shape (n, 3) [m].

    Yields:
        Each point with one cell per direction of motion; no cells if the arm does not reach the point.

    Raises:
        HricError: no contact with the region is permitted, or the table of limits has no such region.
    """
    force = request.check()
    postures, blows = Postures(robot), Blows(robot, request.arm)
    mechanism, link = arm_mechanism(robot), f"{robot.arm_id}_link8"

    def cell(q: FloatArray, point: FloatArray, name: str) -> MapCell:
        masses = mechanism.robot_masses(q, link, point.tolist(), DIRECTIONS[name])
        return _cell(blows, q, point, name, request, force, masses)

    for point in points:
        q = postures.at(point)
        yield point, [] if q is None else [cell(q, point, name) for name in DIRECTIONS]


def arm_mechanism(robot: FrankaHWSim) -> Mechanism:
    """Return the mechanism of a simulated arm with its rotors, in the base frame."""
    tree = urdf.read(robot.description)
    T_base_root = inverse(tree.poses({})[f"{robot.arm_id}_link0"])
    return Mechanism(tree, robot.model.joint_names, robot.rotor_inertia, T_base_root)


def _cell(
    blows: Blows, q: FloatArray, point: FloatArray, name: str, request: MapRequest, force: float, masses: RobotMasses
) -> MapCell:
    approach = blows.approach(q, np.array(DIRECTIONS[name]))
    by_mass = speed_limit(request.limits, request.region, np.array(masses))
    closed_form, by_half, by_locked = (float(speed) for speed in by_mass.transient)
    body = HitBody(REGION_MODELS[request.region].mass, request.limit.stiffness, request.damping)
    speed = limit_speed(lambda speed: blows.peak(approach, body, speed), force, closed_form)
    fastest = approach.fastest
    return MapCell(point, name, masses.reflected, speed, fastest, closed_form, by_half, by_locked, masses.locked)


def limit_speed(force_of: Callable[[float], float], limit: float, guess: float) -> float:
    """Return the speed at which the force reaches its limit [m/s], by search; force and speed are nearly proportional.

    Args:
        force_of: force [N] as a function of the speed [m/s], increasing from 0.
        limit: limit of the force [N].
        guess: first speed to try [m/s].

    Raises:
        FailureError: the force jumps over the limit, so no speed gives it.
    """
    low, high, speed = 0.0, math.inf, guess
    for _ in range(TRIES):
        force = force_of(speed)
        if abs(force - limit) <= CLOSE * limit:
            return speed
        low, high = (speed, high) if force < limit else (low, speed)
        following = speed * limit / force if force > 0.0 else 2.0 * speed
        speed = following if low < following < high else 0.5 * (low + min(high, 4.0 * max(low, guess)))
    raise FailureError(
        f"no limit speed found: the peak force is below {limit:g} N at {low:g} m/s and above it at {high:g} m/s"
    )


def alone(cell: MapCell) -> bool:
    """Return True if the arm alone can reach the limit speed, without a person moving towards it."""
    return cell.fastest >= cell.speed


def lowest(cells: Sequence[MapCell]) -> MapCell:
    """Return the cell with the lowest limit speed."""
    return min(cells, key=lambda cell: cell.speed)


def by_height(cells_by_point: Mapping[tuple[float, ...], list[MapCell]]) -> dict[float, list[MapCell]]:
    """Return, for each height [m], the direction with the lowest limit speed at each of its points."""
    heights: dict[float, list[MapCell]] = {}
    for cells in cells_by_point.values():
        if cells:
            heights.setdefault(float(cells[0].point[2]), []).append(lowest(cells))
    return dict(sorted(heights.items()))
