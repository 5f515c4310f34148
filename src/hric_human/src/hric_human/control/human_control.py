"""Controller of a human with delayed, noisy senses and limited strength.

No physics engine is used: equal states and an equal seed give bitwise equal torques.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from hric_core import plugins
from hric_core.errors import HricError, UnknownNameError
from hric_core.geometry import ORIGIN, Pose, Vector, compose, from_rotation_vector
from hric_core.geometry.quaternions import inverse, product, rotated
from hric_core.native import vectors
from hric_core.parameters import Mistakes, Settings, anything, below, choice, number, refused, section, text, unknown
from hric_human.body import Body
from hric_human.control.controller import HumanController, Person, Senses
from hric_human.control.kinematics import GRAVITY, HandChain, own_weight
from hric_human.control.strength import strength

WORLD = Pose()
CYCLE = 1e-3
"""Default time between two updates of the control loop [s]."""
NOISE_BLOCK = 256
"""Number of cycles whose noise is drawn at once."""
_NOISE_SEED = 2
"""Second part of the seed of sensor noise, so that it is independent of the noise of hand programs and cameras."""


@dataclass(frozen=True)
class SenseSettings(Settings):
    """Delays and white noise (standard deviations) of a human's senses."""

    joint_delay: float = number(
        0.05,
        minimum=0.0,
        maximum=1.0,
        unit="s",
        text="of joint positions and velocities; reflexes take 50 to 100 ms (unconfirmed)",
    )
    hand_delay: float = number(0.2, minimum=0.0, maximum=1.0, unit="s", text="of the hand's pose, which is seen")
    force_delay: float = number(0.08, minimum=0.0, maximum=1.0, unit="s", text="of the force on the hand")
    joint_noise: float = number(0.0, minimum=0.0, unit="rad", text="of joint positions")
    velocity_noise: float = number(0.0, minimum=0.0, unit="rad/s", text="of joint velocities")
    hand_noise: float = number(0.0, minimum=0.0, unit="m", text="of the hand's position, per axis")
    rotation_noise: float = number(0.0, minimum=0.0, unit="rad", text="of the hand's orientation, per axis")
    force_noise: float = number(0.0, minimum=0.0, unit="N", text="of the force on the hand, per axis")


@dataclass(frozen=True)
class ControlSettings(Settings):
    """Settings of a human's control: controller plugin, its parameters, controlled hand, and senses."""

    separator: ClassVar[str] = "."
    type: str = text("hric_human/ImpedanceArm", text="plugin name of the controller")
    parameters: Any = anything({}, default_text="`{}`", text="of the controller")
    side: str = choice(
        "dominant",
        "right",
        "left",
        text="hand that tracks references and senses forces; dominant: the dominant one, if the body has it",
    )
    senses: SenseSettings = section(SenseSettings, text="delays and noise")


class _Delayed:
    """Delay line and noise of the sensed quantities.

    Args:
        settings: delays and noise.
        count: number of joints.
        hand: function, joint positions [rad] -> pose of the hand in the world.
        seed: seed of the noise.
        cycle: cycle time [s].

    Raises:
        ParameterError: a delay is not a multiple of the cycle.
    """

    def __init__(
        self, settings: SenseSettings, count: int, hand: Callable[[Sequence[float]], Pose], seed: int, cycle: float
    ) -> None:
        mistakes = Mistakes()
        cycles = []
        for name in ("joint_delay", "hand_delay", "force_delay"):
            delay = getattr(settings, name)
            cycles.append(round(delay / cycle))
            with mistakes.noted():
                if abs(cycles[-1] * cycle - delay) > 1e-9:
                    raise refused(f"{settings.prefix}{name}", delay, f"a multiple of the cycle, {cycle:g} s")
        mistakes.raise_all()
        self._joint, self._hand, self._force = (-1 - late for late in cycles)
        self._past: deque[tuple[tuple[tuple[float, ...], tuple[float, ...]], Vector]] = deque(maxlen=max(cycles) + 1)
        self._pose = hand
        deviations = (
            [settings.joint_noise] * count
            + [settings.velocity_noise] * count
            + [settings.hand_noise] * 3
            + [settings.rotation_noise] * 3
            + [settings.force_noise] * 3
        )
        self._count, self._deviations, self._noisy = count, np.array(deviations), any(deviations)
        self._random = np.random.default_rng((seed, _NOISE_SEED))
        self._block: list[list[float]] = []

    def sensed(self, q: Sequence[float], dq: Sequence[float], force: Vector) -> Senses:
        """Store the current state and return the delayed one; before the first delay has passed, the initial state."""
        past, muscles = self._past, (tuple(q), tuple(dq))
        if not past:
            past.extend([(muscles, force)] * (past.maxlen or 1))
        else:
            past.append((muscles, force))
        late_q, late_dq = past[self._joint][0]
        hand_q, late_force = past[self._hand][0][0], past[self._force][1]
        if not self._noisy:
            return Senses(late_q, late_dq, late_force, lambda: self._pose(hand_q), muscles)
        if not self._block:
            drawn = self._random.standard_normal((NOISE_BLOCK, len(self._deviations)))
            self._block = (drawn * self._deviations).tolist()
        n, noise = self._count, self._block.pop()
        x, y, z = late_force
        return Senses(
            vectors.add(late_q, noise[:n]),
            vectors.add(late_dq, noise[n : 2 * n]),
            (x + noise[-3], y + noise[-2], z + noise[-1]),
            lambda: _shaken(self._pose(hand_q), noise[-9:-3]),
            muscles,
        )


def _shaken(pose: Pose, noise: Sequence[float]) -> Pose:
    (x, y, z), (dx, dy, dz) = pose.position, noise[:3]
    return Pose((x + dx, y + dy, z + dz), product(from_rotation_vector(noise[3:]), pose.orientation))


class HumanControl:
    """Control loop of a human: delayed senses, controller plugin, strength limits. Called from one thread.

    Args:
        body: body whose joints are driven, in the order of `body.joints`.
        content: mapping of ControlSettings.
        seed: seed of all randomness.
        T_world_root: pose of the body's root link in the frame of hand references, forces and observations (the robot's
            base, in experiments).
        gravity: gravity vector in axes of the world [m/s^2].
        cycle: time between two updates [s].
        where: name of the mapping, for error messages.

    Attributes:
        person: data of the body for the controller.
        posture: initial joint positions, n floats [rad].
        end: time from the start of the motion to rest [s]; infinite if unknown.
        clipped: number of times that each joint reached its maximum strength, by joint.
        at_strength: True for each joint that is at its maximum strength in this cycle.

    Raises:
        ParameterError: an invalid parameter, or a reference out of reach; all mistakes at once.
    """

    def __init__(
        self,
        body: Body,
        content: Any,
        seed: int,
        T_world_root: Pose = WORLD,
        gravity: Vector = GRAVITY,
        cycle: float = CYCLE,
        where: str = "human.control",
    ) -> None:
        settings, controller, parameters = checked(content, tuple(body.joints), where)
        side = hand_side(body, settings.side, where)
        weakest, strongest = strength(body)
        gravity = rotated(inverse(T_world_root.orientation), gravity)
        ranges = [joint.range for joint in body.joints.values()]
        self.person = Person(
            body,
            tuple(body.joints),
            tuple(low for low, _ in ranges),
            tuple(high for _, high in ranges),
            weakest,
            strongest,
            resting_posture(body),
            side,
            HandChain(body, side),
            own_weight(body, gravity),
            gravity,
            T_world_root,
            seed,
            cycle,
        )
        self._settings, self._new_controller, self._parameters = settings, controller, parameters
        self.restart(seed)

    def restart(self, seed: int | None = None) -> None:
        """Reset to the state before the first `update`, with a new controller for the same person; None: same seed."""
        if seed not in (None, self.person.seed):
            self.person = replace(self.person, seed=seed, solved={})
        person, senses = self.person, self._settings.senses
        count = len(person.joints)
        self._senses = _Delayed(senses, count, self._hand, person.seed, person.cycle)
        self.clipped = dict.fromkeys(person.joints, 0)
        self.at_strength = [False] * count
        self._any_at_strength, self._running = False, False
        self._controller = self._new_controller()
        self._controller.init(person, self._parameters)
        self.end, posture = self._controller.end, self._controller.posture()
        self.posture = list(self.person.rest) if posture is None else self._as_list(posture)

    def start(self, time: float) -> None:
        """Start the motion at `time` [s]."""
        self._controller.start(time)

    def see(self, time: float, position: Vector) -> None:
        """Pass the position [m] of the robot's end effector in the world at `time` to the controller."""
        self._controller.see(time, position)

    def update(self, time: float, q: Sequence[float], dq: Sequence[float], force: Vector = ORIGIN) -> list[float]:
        """Return the joint torque until the next cycle, within the strength of each joint, n floats [N m].

        Args:
            time: robot time [s].
            q: current joint positions, n floats [rad].
            dq: current joint velocities, n floats [rad/s].
            force: force on the hand, axes of the world [N].

        Raises:
            HricError: the controller cannot continue, or returns an invalid torque.
        """
        senses = self._senses.sensed(q, dq, force)
        if not self._running:
            self._running = True
            self._controller.starting(time, senses)
        tau = self._controller.update(time, senses)
        person = self.person
        if type(tau) is not list or len(tau) != len(person.joints):
            tau = self._as_list(tau)
        if vectors.within(tau, person.weakest, person.strongest):
            if self._any_at_strength:
                self._any_at_strength, self.at_strength = False, [False] * len(tau)
            return tau
        return self._within_strength(time, tau)

    def _hand(self, q: Sequence[float]) -> Pose:
        return compose(self.person.T_world_root, self.person.hand.pose(q))

    def _as_list(self, tau: Sequence[float]) -> list[float]:
        values = [float(value) for value in tau]
        if len(values) != len(self.person.joints):
            raise HricError(
                f"{type(self._controller).__name__} returned {len(values)} values; valid: one for each of "
                f"{', '.join(self.person.joints)}"
            )
        return values

    def _within_strength(self, time: float, tau: list[float]) -> list[float]:
        """Return the torque clipped to the strength, and count the joints that became saturated."""
        person, before = self.person, self.at_strength
        self.at_strength, self._any_at_strength = [], True
        limited_tau = []
        for index, (value, low, high) in enumerate(zip(tau, person.weakest, person.strongest, strict=True)):
            if not math.isfinite(value):
                raise HricError(
                    f"{type(self._controller).__name__} returned {value} N m for {person.joints[index]} "
                    f"at {time:.3f} s; valid: finite torques"
                )
            limited = min(max(value, low), high)
            self.at_strength.append(limited != value)
            if limited != value and not before[index]:
                self.clipped[person.joints[index]] += 1
            limited_tau.append(limited)
        return limited_tau


def resting_posture(body: Body) -> tuple[float, ...]:
    """Return the joint angles of a person at rest, elbows slightly bent, n floats [rad].

    With straight elbows a hand could not move along the arm. Project default, unconfirmed.
    """
    return tuple(body.rest.get(name, RESTING.get(joint.row.name, 0.0)) for name, joint in body.joints.items())


RESTING = {"sh_flex": math.radians(20), "sh_abd": math.radians(15), "el_flex": math.radians(80)}
"""Angles of a person at rest that are not zero, by joint without its side [rad]."""


def checked(content: Any, joints: tuple[str, ...], where: str) -> tuple[ControlSettings, type[HumanController], Any]:
    """Check a mapping of ControlSettings; return the settings, the controller's class and its parameters.

    Raises:
        ParameterError: all mistakes of the mapping.
    """
    mistakes = Mistakes()
    with mistakes.noted():
        settings = ControlSettings.of(content, where)
    section = content if isinstance(content, Mapping) else {}
    with mistakes.noted():
        controller = _controller(section.get("type", "hric_human/ImpedanceArm"), where)
        parameters = controller.settings.of(section.get("parameters"), f"{below(where)}parameters", joints)
    mistakes.raise_all()
    return settings, controller, parameters


def _controller(name: Any, where: str) -> type[HumanController]:
    try:
        return plugins.find(plugins.HUMAN_CONTROLLER, name)
    except UnknownNameError as error:
        raise unknown("human controller", name, error.valid, f"{below(where)}type") from None


def hand_side(body: Body, side: str, where: str) -> str:
    """Return the side of the hand that tracks the reference and senses forces: "right" or "left".

    Args:
        body: body with the hands.
        side: "dominant", "right" or "left"; "dominant" falls back to the only hand of the body.
        where: name of the mapping of ControlSettings, for error messages.

    Raises:
        ParameterError: the body has no such hand.
    """
    sides = [name for name in ("right", "left") if f"{name}_hand" in body.segments]
    if side == "dominant":
        return body.subject.dominant_hand if body.subject.dominant_hand in sides else sides[0]
    if side not in sides:
        raise refused(f"{below(where)}side", side, f"dominant or {' or '.join(sides)}")
    return side
