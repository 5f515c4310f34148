"""Expected forces of recorded contacts: closed-form impact on a spring, and clamping by the commanded torque. No ROS.

Two masses that collide with speed v on a spring k have a half-sine force: peak v sqrt(mu k), duration pi sqrt(mu/k),
impulse 2 mu v with 1/mu = 1/m_R + 1/m_H (ISO/TS 15066:2016, Annex A). Instead of the standard's masses, the reflected
masses of the robot, with its rotors, and of the simulated body are used: 1 / (n' J (M + B)^-1 J' n), at the contact
point along the contact normal. Other forces during the contact and the rotation of both bodies are neglected.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from hric_assessment.contact.mass import Mechanism, RobotMasses
from hric_assessment.tables import MASS, ROTORS, STIFFNESS, episode_table, verdict_table
from hric_assessment.typed_json import Content, JsonObject
from hric_bags.reader import ControlRecord, FloatArray, RunRecord
from hric_bags.records.human_record import HumanRecord
from hric_bags.run_file import robots
from hric_control.plant import Surface
from hric_control.plants import PlantConfig, Surfaces, carried, combine, load_surfaces, rotor_inertia
from hric_core import urdf
from hric_core.errors import HricError, check_known
from hric_human.body import surfaces
from hric_human.contact import RegionContact
from hric_human.participant.settings import HumanSettings
from hric_human.participant.walk import JOINTS, Walk

LASTING = episode_table()["transient_time"]
"""Minimum duration of a contact that counts as clamping, in which the commanded torque balances the force [s]."""
SETTLED, MEAN = 2.0, 0.1
"""Time after the first touch at which a clamping is judged (its end if shorter), and averaging time before that [s].

Project defaults, unconfirmed.
"""
RATE = 50.0
"""Maximum rate at which the torque of a clamping is evaluated [Hz] (project default, unconfirmed)."""
OWN_WEIGHT = ("franka_sim/FrankaHWSim", "franka_real/FrankaHW")
"""RobotHW classes of arms that compensate gravity in addition to the commanded torque."""


@dataclass(frozen=True)
class ClosedFormImpact:
    """Closed-form impact of two masses on a spring.

    Attributes:
        speed: approach speed along the normal [m/s].
        robot_mass, human_mass: reflected masses along the normal [kg].
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
        """Return the half-sine force, shape (n,) [N]; time: time since the first touch, shape (n,) [s]."""
        touching = (time >= 0.0) & (time <= self.duration)
        return np.where(touching, self.peak * np.sin(math.pi * time / self.duration), 0.0)


@dataclass(frozen=True)
class Clamping:
    """Contact force during a clamping, and the force that the commanded joint torque would balance statically.

    Attributes:
        time: robot time, shape (n,) [s].
        force: contact force, shape (n,) [N].
        balanced: force along the normal with which the commanded torque presses, shape (n,) [N].
    """

    time: FloatArray
    force: FloatArray
    balanced: FloatArray

    def level(self) -> tuple[float, float, float]:
        """Return the robot time [s] at which the clamping is judged, and the mean of both forces before it [N]."""
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
"""Attributes of `RegionContact` that are written to metrics.json under their own names."""


@dataclass(frozen=True)
class ExpectedContact:
    """Recorded contact with the forces that are expected of it.

    Attributes:
        contact: contact as recorded.
        impact: closed-form impact; None for a rigid or damped contact, one that is not with a link of the robot, or an
            unknown or zero approach speed.
        clamping: forces over time; None if the contact is too short for a clamping, has too few messages, or the
            command is not a torque.
    """

    contact: RegionContact
    impact: ClosedFormImpact | None
    clamping: Clamping | None

    @property
    def peak(self) -> float | None:
        """Largest recorded force until the expected half sine ends [N]; None: no closed form."""
        if self.impact is None:
            return None
        series = self.contact.series
        after = np.flatnonzero(series.time >= self.contact.begin + self.impact.duration)
        return float(series.reached[after[0]]) if len(after) else self.contact.peak

    def late(self) -> float:
        """Return the time from the begin of the half sine to the first message, computed from its force [s]."""
        form, force = self.impact, self.contact.series.force
        if form is None or not len(force):
            return 0.0
        return form.duration / math.pi * math.asin(min(float(force[0]) / form.peak, 1.0))

    def values(self) -> JsonObject:
        """Return recorded and expected values as an object for metrics.json."""
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


class ClosedFormModels:
    """Models of the robot and the human of a run, from which the expected forces of their contacts are computed.

    Args:
        run: contents of run.yaml.
        description: URDF of the robot.
        log: control log of the robot.
        human: recording of the human.
        factors: factors of unconfirmed numbers, by their names in config/tables/uncertain.yaml; a missing one is 1.

    Raises:
        HricError: a description, a world file or a parameter is no longer usable, the recorded joints are those of
            another body, or the position of a walking person is not recorded.
    """

    def __init__(
        self,
        run: Content,
        description: str,
        log: ControlRecord,
        human: HumanRecord,
        factors: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        definition, parameters = run.get("definition") or {}, (run.get("parameters") or {}).get("robot") or {}
        known = ("rotor_inertia", "surfaces", "world", "contact_stiffness", "payload")
        plant = {name: value for name, value in (parameters.get("plant") or {}).items() if name in known}
        config = PlantConfig.of(plant, "plant/", log.joint_names)
        self._log, self._record = log, human
        settings = HumanSettings.of(definition["human"], "human")
        body = settings.body()
        check_known("joint", human.joints, body.joints, "the body of the run")
        if settings.walk is not None and human.root is None:
            raise HricError(f"the position of the walking person is not recorded (topic {human.name}/root)")
        root = settings.root(body)
        T_world_root = root.transform()
        described, joints, self._human_q = body.urdf, human.joints, human.position
        if settings.walk is not None and human.root is not None:  # the root joints of the walking person yield, too
            described, joints = Walk(settings.walk, body, settings.heading).urdf, (*JOINTS, *human.joints)
            walked = human.root.at(human.time)[:, :2] - np.array(root.position[:2])
            self._human_q = np.hstack([walked, human.position])
        tree = urdf.read(description)
        rotors = [factors.get(ROTORS, 1.0) * value for value in rotor_inertia(plant, log.joint_names, tree)]
        self._robot = Mechanism(tree, log.joint_names, rotors, payloads=carried(config.payload, tree, log.joint_names))
        self._human = Mechanism(urdf.read(described), joints, [0.0] * len(joints), T_world_root)
        rules = Surfaces((*load_surfaces(config.world), *config.surfaces), config.contact_stiffness)
        self._name = self._robot.tree.name
        self._skin = rules.of_model("human", body.regions, Surface(), surfaces(body, settings.contact_law))
        self._skin |= {
            link: replace(surface, stiffness=factors.get(STIFFNESS, 1.0) * surface.stiffness)
            for link, surface in self._skin.items()
            if surface.stiffness is not None
        }
        self._heavier = factors.get(MASS, 1.0)
        self._hull = rules.of_model(self._name, self._robot.tree.links, Surface())
        self._torque = all(robot.get("hw") in OWN_WEIGHT for robot in robots(definition))

    def expected(self, contact: RegionContact) -> ExpectedContact:
        """Return a contact with the forces that are expected of it."""
        if not self._ours(contact):
            return ExpectedContact(contact, None, None)
        return ExpectedContact(
            contact, self.impact(contact), self._clamping(contact, contact.other.rpartition("::")[2])
        )

    def _ours(self, contact: RegionContact) -> bool:
        """Return True for a penalty contact between the person and a link of the robot."""
        other, _, link = contact.other.rpartition("::")
        return contact.kind == "penalty" and other == self._name and contact.link in self._skin and link in self._hull

    def impact(self, contact: RegionContact) -> ClosedFormImpact | None:
        """Return the closed-form impact of a contact; None if its conditions or values are not known.

        The conditions are those of `ExpectedContact.impact`; arm and person must be recorded at that time.
        """
        if not self._ours(contact):
            return None
        link = contact.other.rpartition("::")[2]
        law, speed = combine(self._skin[contact.link], self._hull[link]), contact.begin_speed or 0.0
        point, normal = contact.begin_point, contact.begin_normal
        if law is None or not law[0].elastic or point is None or normal is None or speed <= 0.0:
            return None
        log, record = self._log, self._record
        if not (_recorded(contact.begin, log.time) and _recorded(contact.begin, record.time)):
            return None
        q_robot, q_human = _at(contact.begin, log.time, log.position), _at(contact.begin, record.time, self._human_q)
        robot_mass = self._robot.reflected_mass(q_robot, link, point, normal)
        human_mass = self._heavier * self._human.reflected_mass(q_human, contact.link, point, normal)
        if math.isinf(robot_mass) and math.isinf(human_mass):
            return None
        return ClosedFormImpact(speed, robot_mass, human_mass, law[0].stiffness)

    def robot_masses(self, contact: RegionContact, load: float) -> RobotMasses:
        """Return the estimates of the robot's effective mass at the first touch of a contact, if `impact` knows it.

        load: held mass [kg].
        """
        q, link = _at(contact.begin, self._log.time, self._log.position), contact.other.rpartition("::")[2]
        assert contact.begin_point is not None and contact.begin_normal is not None, "`impact` has tested it"
        return self._robot.robot_masses(q, link, contact.begin_point, contact.begin_normal, load)

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
    """Return True if a sample lies near enough to a time [s] to be used for it; times: of samples, shape (n,) [s]."""
    return bool(np.abs(times - time).min(initial=np.inf) <= verdict_table()["max_gap"])


def _at(time: float | FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate values, shape (n, j), linearly: at one time, shape (j,), or at m times, shape (m, j)."""
    return np.array([np.interp(time, times, column) for column in values.T]).T


def expected_contacts(run: Content, description: str, record: RunRecord, human: HumanRecord) -> list[ExpectedContact]:
    """Return all contacts of a run with the forces expected of them, in order of their ends.

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
    except HricError:  # for instance a world file that no longer exists: the recorded values are still reported
        return [ExpectedContact(contact, None, None) for contact in human.region_contacts]
    return [models.expected(contact) for contact in human.region_contacts]
