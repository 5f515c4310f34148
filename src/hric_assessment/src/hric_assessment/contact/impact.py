"""Comparison of spring contacts with a closed-form impact, and of clamping with the commanded torque. No ROS.

Two masses that collide with a speed v on a spring k give half a sine: peak v sqrt(mu k), duration pi sqrt(mu/k),
impulse 2 mu v with 1/mu = 1/m_R + 1/m_H (ISO/TS 15066:2016, Annex A). The masses here are not the standard's but the
reflected masses of the robot, with its rotors, and of the simulated body, 1 / (n' J (M + B)^-1 J' n), at the contact
point along the contact normal. Other forces during the contact and the rotation of both bodies are neglected.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hric_assessment.tables import episode_table, verdict_table
from hric_assessment.typed_json import Content, JsonObject
from hric_bags.reader import ControlRecord, FloatArray, RunRecord
from hric_bags.records.human_record import HumanRecord
from hric_control.plant import Surface
from hric_control.plants import PlantConfig, Surfaces, combine, load_surfaces
from hric_core import urdf
from hric_core.errors import HricError, check_known
from hric_core.geometry.transforms import inverse
from hric_dynamics.tree import Tree
from hric_human.body import surfaces
from hric_human.contact import RegionContact
from hric_human.participant.settings import HumanSettings
from hric_human.participant.walk import JOINTS, Walk

LASTING = episode_table()["transient_time"]
"""Minimum duration of a clamping, whose force the commanded torque balances [s]."""
SETTLED, MEAN = 2.0, 0.1
"""Time after the first touch at which a clamping is judged (at its end if shorter), and averaging time before it [s].

Requirement of this project on a clamped contact (project default, unconfirmed).
"""
RATE = 50.0
"""Largest rate at which the torque of a clamping is evaluated [Hz] (project default, unconfirmed)."""
OWN_WEIGHT = ("franka_sim/FrankaHWSim", "franka_real/FrankaHW")
"""Arms that compensate gravity in addition to the commanded torque."""


@dataclass(frozen=True)
class ClosedFormImpact:
    """Closed form of one impact.

    Attributes:
        speed: approach speed along the normal [m/s].
        robot_mass, human_mass: reflected masses [kg].
        stiffness: contact stiffness of the pair [N/m].
    """

    speed: float
    robot_mass: float
    human_mass: float
    stiffness: float

    @property
    def mass(self) -> float:
        """Reduced mass mu [kg]."""
        return 1.0 / (1.0 / self.robot_mass + 1.0 / self.human_mass)

    @property
    def peak(self) -> float:
        """Peak force v sqrt(mu k) [N]."""
        return self.speed * math.sqrt(self.mass * self.stiffness)

    @property
    def duration(self) -> float:
        """Contact duration pi sqrt(mu/k) [s]."""
        return math.pi * math.sqrt(self.mass / self.stiffness)

    @property
    def impulse(self) -> float:
        """Impulse 2 mu v [N s]."""
        return 2.0 * self.mass * self.speed

    def force(self, time: FloatArray) -> FloatArray:
        """Return the half-sine force, shape (n,) [N]; time: since the first touch, shape (n,) [s]."""
        touching = (time >= 0.0) & (time <= self.duration)
        return np.where(touching, self.peak * np.sin(math.pi * time / self.duration), 0.0)


@dataclass(frozen=True)
class Clamping:
    """Contact force and the force that the commanded torque balances during a clamping.

    Attributes:
        time: robot time, shape (n,) [s].
        force: contact force, shape (n,) [N].
        balanced: force along the normal that the command balances, shape (n,) [N].
    """

    time: FloatArray
    force: FloatArray
    balanced: FloatArray

    def level(self) -> tuple[float, float, float]:
        """Return (robot time [s], force [N], balanced force [N]) at the instant of judgement."""
        end = min(self.time[0] + SETTLED, self.time[-1])
        last = (self.time > end - MEAN) & (self.time <= end)
        return float(end), float(self.force[last].mean()), float(self.balanced[last].mean())


RECORDED = (
    "regions",
    "link",
    "other",
    "kind",
    "begin",
    "duration",
    "peak",
    "peak_time",
    "impulse",
    "dominant",
    "area",
    "ended",
    "interrupted",
)
"""Attributes of a contact that metrics.json has by the same names."""


@dataclass(frozen=True)
class ExpectedContact:
    """One contact and its expected values.

    Attributes:
        contact: contact as recorded.
        impact: closed form; None for a rigid or damped contact, one that is not with a link of the robot, or an
            unknown or zero approach speed.
        clamping: force over time; None if it is too short, has too few messages, or the command is not a torque.
    """

    contact: RegionContact
    impact: ClosedFormImpact | None
    clamping: Clamping | None

    @property
    def peak(self) -> float | None:
        """Largest force until the half sine ends, which is after the first peak [N]; None: no closed form."""
        if self.impact is None:
            return None
        series = self.contact.series
        after = np.flatnonzero(series.time >= self.contact.begin + self.impact.duration)
        return float(series.reached[after[0]]) if len(after) else self.contact.peak

    def late(self) -> float:
        """Return the delay of the first message after the start of the half sine, from its force [s]."""
        form, force = self.impact, self.contact.series.force
        if form is None or not len(force):
            return 0.0
        return form.duration / math.pi * math.asin(min(float(force[0]) / form.peak, 1.0))

    def values(self) -> JsonObject:
        """Return the values for metrics.json."""
        contact = self.contact
        recorded = {name: getattr(contact, name) for name in RECORDED}
        begin = {"point": contact.begin_point, "normal": contact.begin_normal, "speed": contact.begin_speed}
        form, peak, impact, clamping = self.impact, self.peak, None, None
        if form is not None and peak is not None:
            expected = {name: getattr(form, name) for name in ("mass", "peak", "duration", "impulse")}
            impact = {**vars(form), **expected, "measured_peak": peak, "ratio": peak / form.peak}
        if self.clamping is not None:
            time, force, balanced = self.clamping.level()
            clamping = {"time": time, "force": force, "balanced": balanced, "ratio": force / balanced}
        return {**recorded, **begin, "transient": impact, "press": clamping}


class Mechanism:
    """Description placed in the world, with its mobility at a point.

    Args:
        tree: the description.
        joints: joints that move; all others are fixed at zero.
        rotors: rotor inertia at each joint [kg m^2].
        T_world_root: pose of the root link, shape (4, 4).
    """

    def __init__(
        self, tree: urdf.Robot, joints: Sequence[str], rotors: Sequence[float], T_world_root: FloatArray | None = None
    ) -> None:
        self.tree, self.joints, self._rotors = tree, tuple(joints), np.diag(rotors)
        self._dynamics = Tree(tree, joints)
        self._T_root_world = np.eye(4) if T_world_root is None else inverse(T_world_root)

    def at(self, q: FloatArray, link: str, point: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """Return (J, (M + B)^-1) for a point of a link, world frame, shapes (3, n) and (n, n).

        Args:
            q: joint positions, shape (n,) [rad].
            link: link of the description.
            point: point in the world, 3 floats [m].
        """
        R, p = self._T_root_world[:3, :3], self._T_root_world[:3, :3] @ point + self._T_root_world[:3, 3]
        J = np.asarray(R.T @ self._dynamics.point_jacobian(q.tolist(), link, p.tolist()))
        return J, np.asarray(np.linalg.inv(self._dynamics.mass_matrix(q.tolist()) + self._rotors))

    def reflected_mass(self, q: FloatArray, link: str, point: Sequence[float], normal: Sequence[float]) -> float:
        """Return 1 / (n' J (M + B)^-1 J' n) [kg]; infinite where no joint lets the link yield along n."""
        J, inverse_mass = self.at(q, link, point)
        row = np.array(normal) @ J
        mobility = float(row @ inverse_mass @ row)
        return 1.0 / mobility if mobility > 0.0 else math.inf

    def balanced(
        self, q: FloatArray, link: str, point: Sequence[float], normal: Sequence[float], tau: FloatArray
    ) -> float:
        """Return the force along a normal with which static efforts press at the point [N].

        It is n' (J W J')^-1 J W tau with W = (M + B)^-1, which is f where tau = J' f.
        """
        J, W = self.at(q, link, point)
        return float(np.array(normal) @ np.linalg.solve(J @ W @ J.T, J @ W @ tau))


class ClosedFormModels:
    """Models of the robot and the human of a run, for the expected values of their contacts.

    Args:
        run: contents of run.yaml.
        description: URDF of the robot.
        log: control log of the robot.
        human: recording of the human.

    Raises:
        HricError: a description, a world file or a parameter that is no longer usable, joints of another body, or no
            recorded position of a walking person.
    """

    def __init__(self, run: Content, description: str, log: ControlRecord, human: HumanRecord) -> None:
        definition, parameters = run.get("definition") or {}, (run.get("parameters") or {}).get("robot") or {}
        known = ("rotor_inertia", "surfaces", "world", "contact_stiffness")
        plant = {name: value for name, value in (parameters.get("plant") or {}).items() if name in known}
        config = PlantConfig.of(plant, "plant/", log.joint_names)
        self._log, self._record = log, human
        settings = HumanSettings.of(definition["human"], "human")
        body = settings.body()
        check_known("joint", human.joints, body.joints, "the body of the run")
        if settings.walk is not None and human.root is None:
            raise HricError(f"where the walking person was is not recorded: {human.name}/root")
        root = settings.root(body)
        T_world_root = root.transform()
        described, joints, self._human_q = body.urdf, human.joints, human.position
        if settings.walk is not None and human.root is not None:  # the root joints of the walking person yield, too
            described, joints = Walk(settings.walk, body, settings.heading).urdf, (*JOINTS, *human.joints)
            walked = human.root.at(human.time)[:, :2] - np.array(root.position[:2])
            self._human_q = np.hstack([walked, human.position])
        self._robot = Mechanism(urdf.read(description), log.joint_names, config.rotor_inertia)
        self._human = Mechanism(urdf.read(described), joints, [0.0] * len(joints), T_world_root)
        rules = Surfaces((*load_surfaces(config.world), *config.surfaces), config.contact_stiffness)
        self._name = self._robot.tree.name
        self._skin = rules.of_model("human", body.regions, Surface(), surfaces(body))
        self._hull = rules.of_model(self._name, self._robot.tree.links, Surface())
        self._torque = definition.get("robot", {}).get("hw") in OWN_WEIGHT

    def expected(self, contact: RegionContact) -> ExpectedContact:
        """Return a contact with its expected values."""
        if not self._ours(contact):
            return ExpectedContact(contact, None, None)
        return ExpectedContact(
            contact, self.impact(contact), self._clamping(contact, contact.other.rpartition("::")[2])
        )

    def _ours(self, contact: RegionContact) -> bool:
        """Return True if a contact is a penalty contact between the person and the robot."""
        other, _, link = contact.other.rpartition("::")
        return contact.kind == "penalty" and other == self._name and contact.link in self._skin and link in self._hull

    def impact(self, contact: RegionContact) -> ClosedFormImpact | None:
        """Return the closed form; None: see `ExpectedContact`, or arm or person were not recorded at that time."""
        if not self._ours(contact):
            return None
        link = contact.other.rpartition("::")[2]
        law, speed = combine(self._skin[contact.link], self._hull[link]), contact.begin_speed or 0.0
        point, normal = contact.begin_point, contact.begin_normal
        if law is None or law[1] or point is None or normal is None or speed <= 0.0:
            return None
        log, record = self._log, self._record
        if not (_recorded(contact.begin, log.time) and _recorded(contact.begin, record.time)):
            return None
        q_robot, q_human = _at(contact.begin, log.time, log.position), _at(contact.begin, record.time, self._human_q)
        robot_mass = self._robot.reflected_mass(q_robot, link, point, normal)
        human_mass = self._human.reflected_mass(q_human, contact.link, point, normal)
        if math.isinf(robot_mass) and math.isinf(human_mass):
            return None
        return ClosedFormImpact(speed, robot_mass, human_mass, law[0])

    def _clamping(self, contact: RegionContact, link: str) -> Clamping | None:
        log, series = self._log, contact.series
        effort = log.by_effort is None or bool(log.by_effort.all())
        if not self._torque or not effort or "effort" not in log.interfaces:
            return None
        if contact.duration < LASTING or len(series.time) < contact.duration / MEAN:
            return None
        count = math.ceil(contact.duration * RATE)
        chosen = np.unique(np.linspace(0, len(series.time) - 1, count).round().astype(int))
        time = series.time[chosen]
        q, tau = _at(time, log.time, log.position), _at(time, log.time, log.command)
        balanced = [
            self._robot.balanced(q[i], link, series.point[k], series.normal[k], tau[i]) for i, k in enumerate(chosen)
        ]
        return Clamping(time, series.force[chosen], np.array(balanced))


def _recorded(time: float, times: FloatArray) -> bool:
    """Return True if a sample lies near enough to a time [s]; times: shape (n,) [s]."""
    return bool(np.abs(times - time).min(initial=np.inf) <= verdict_table()["max_gap"])


def _at(time: float | FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    """Return the interpolated columns of values, shape (n, j), at one time, shape (j,), or at several, shape (m, j)."""
    return np.array([np.interp(time, times, column) for column in values.T]).T


def expected_contacts(run: Content, description: str, record: RunRecord, human: HumanRecord) -> list[ExpectedContact]:
    """Return all contacts of a run with their expected values, in order of their ends.

    Args:
        run: contents of run.yaml.
        description: URDF of the robot; "": the run folder has none.
        record: recording of the robot.
        human: recording of the human.
    """
    if not any(contact.kind == "penalty" for contact in human.region_contacts) or not description:
        return [ExpectedContact(contact, None, None) for contact in human.region_contacts]
    try:
        models = ClosedFormModels(run, description, record.log, human)
    except HricError:  # a world file that no longer exists: the recorded values are reported all the same
        return [ExpectedContact(contact, None, None) for contact in human.region_contacts]
    return [models.expected(contact) for contact in human.region_contacts]
