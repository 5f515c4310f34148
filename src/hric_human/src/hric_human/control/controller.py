"""Base class of a human's controllers, and the data of the body that they receive.

A user's class is found through the plugin export of its package.xml (base class "hric_human::HumanController"):

    class Hold(HumanController):
        settings = HoldSettings                      # a Settings of hric_core.parameters

        def init(self, person, settings):
            self._k, self._weight = settings.stiffness, person.own_weight

        def starting(self, time, senses):
            self._q = senses.q

        def update(self, time, senses):
            held, muscles = self._weight(senses.q), zip(*senses.muscles)
            return [k * (a - b - 0.05 * v) + g for k, a, (b, v), g in zip(self._k, self._q, muscles, held)]
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from hric_core.geometry import Pose, Vector
from hric_core.parameters import Settings
from hric_human.body import Body
from hric_human.control.kinematics import HandChain, Torque


@dataclass(frozen=True)
class Person:
    """Person whose joints a controller drives; joints are those of `body.joints`, in their order.

    Attributes:
        body: description of the body.
        joints: names of the joints.
        lower, upper: ranges [rad].
        weakest, strongest: strength in the negative and in the positive sense, the former negative [N m].
        rest: resting posture [rad].
        side: side of the hand that tracks references and senses forces.
        hand: kinematics of that hand.
        own_weight: function, joint angles [rad] -> joint torques that hold the body against gravity [N m].
        gravity: gravity vector in axes of the root link [m/s^2].
        T_world_root: pose of the body's root link in the frame of hand references and forces.
        seed: seed of all randomness.
        cycle: time between two updates [s].
        solved: solutions of inverse kinematics that depend on this person alone, kept over resets.
        starts: the last solution for the start of a motion, also kept if the seed changes.
    """

    body: Body
    joints: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    weakest: list[float]
    strongest: list[float]
    rest: tuple[float, ...]
    side: str
    hand: HandChain
    own_weight: Torque
    gravity: Vector
    T_world_root: Pose
    seed: int
    cycle: float
    solved: dict[object, list[list[float]]] = field(default_factory=dict)
    starts: dict[object, list[float]] = field(default_factory=dict)


class Senses:
    """Sensed quantities of a human in one control cycle, each with its delay and noise.

    Attributes:
        q: joint positions, n floats [rad].
        dq: joint velocities, n floats [rad/s].
        force: force on the hand, axes of the world [N].
        muscles: current joint positions and velocities, without delay, for the mechanical response of muscles.
    """

    __slots__ = ("_hand", "dq", "force", "muscles", "q")

    def __init__(
        self,
        q: Sequence[float],
        dq: Sequence[float],
        force: Vector,
        hand: Callable[[], Pose],
        muscles: tuple[Sequence[float], Sequence[float]],
    ) -> None:
        self.q, self.dq, self.force, self._hand, self.muscles = q, dq, force, hand, muscles

    @property
    def hand(self) -> Pose:
        """Pose of the hand in the world; computed on access."""
        return self._hand()


class HumanController:
    """Control law of a human's joint torque.

    It is constructed without arguments. `init` may block; `posture` follows it, and the other methods are called in the
    loop and must not block. All randomness comes from `Person.seed`.
    """

    settings: ClassVar[type[Settings]] = Settings
    """Settings class of the controller's parameters; values per joint are in the order of the joints."""
    end: float = math.inf
    """Time from the start of the motion to rest [s]; infinite if unknown."""

    def init(self, person: Person, settings: Any) -> None:
        """Prepare the controller.

        Args:
            person: person whose joints the controller drives.
            settings: checked instance of the class `settings`.

        Raises:
            HricError: the controller cannot run.
        """

    def posture(self) -> Sequence[float] | None:
        """Return the initial joint positions, n floats [rad]; None: the resting posture."""
        return None

    def starting(self, time: float, senses: Senses) -> None:
        """Prepare for the first `update`, which follows in the same cycle; time: robot time [s]."""

    def start(self, time: float) -> None:
        """Start the motion at robot time `time` [s], when the experiment starts; not called if that never happens."""

    def see(self, time: float, position: Vector) -> None:
        """Receive the position [m] of the robot's end effector in the world at `time`."""

    def update(self, time: float, senses: Senses) -> Sequence[float]:
        """Return the joint torque, n floats [N m]; applied until the next cycle.

        Raises:
            HricError: the controller cannot continue; the run ends with the error's text.
        """
        raise NotImplementedError
