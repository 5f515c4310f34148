"""The base class of a human's controllers, and what they know of their body.

A class of a user, found through the plugin export of his package.xml (base class "hric_human::HumanController"):

    class Hold(HumanController):
        settings = HoldSettings                      # a Settings of hric_control.parameters

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
from dataclasses import dataclass
from typing import Any, ClassVar

from hric_control.geometry import Pose, Vector
from hric_control.parameters import Settings
from hric_human.body import Body
from hric_human.control.kinematics import HandChain, Torque


@dataclass(frozen=True)
class Person:
    """Whose joints a controller drives. Joints are those of `body.joints`, in their order.

    Attributes:
        body: its description.
        joints: names.
        lower, upper: ranges [rad].
        weakest, strongest: strength in the negative and in the positive sense, the former negative [N m].
        rest: resting posture [rad].
        side: of the hand that follows references and is felt.
        hand: its kinematics.
        own_weight: joint angles [rad] -> torque that holds the body [N m].
        gravity: in axes of the root link [m/s^2].
        T_world_root: pose of the body's root link in the frame of hand references and forces.
        seed: of what varies.
        cycle: time between two updates [s].
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


class Senses:
    """What a human senses in a cycle, each late by its delay and noisy.

    Attributes:
        q: joint positions, n floats [rad].
        dq: joint velocities, n floats [rad/s].
        force: on the hand, axes of the world [N].
        muscles: joint positions and velocities as they are now, which nobody senses: for what muscles do by themselves.
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
        """Pose of the hand in the world; computed when it is read."""
        return self._hand()


class HumanController:
    """A law of a human's joint torque.

    It is constructed without arguments. `init` may take its time; `posture` follows it, and the others are called in
    the loop and must not block.
    All randomness comes from `Person.seed`.
    """

    settings: ClassVar[type[Settings]] = Settings
    """Its parameters; values per joint are in the order of the joints."""
    end: float = math.inf
    """When its motion has come to rest, after its start [s]; infinite: not known."""

    def init(self, person: Person, settings: Any) -> None:
        """Get ready.

        Args:
            person: whose joints it drives.
            settings: of the class `settings`, checked.

        Raises:
            HricError: the controller cannot run.
        """

    def posture(self) -> Sequence[float] | None:
        """Where the body is at the start, n floats [rad]; None: in the resting posture."""
        return None

    def starting(self, time: float, senses: Senses) -> None:
        """First call in the loop; `update` follows in the same cycle. time: of the run [s]."""

    def start(self, time: float) -> None:
        """The experiment has begun, and with it the motion [s]; not called where nobody says so."""

    def see(self, time: float, position: Vector) -> None:
        """The end effector of the robot was at `position` in the world [m] at `time`."""

    def update(self, time: float, senses: Senses) -> Sequence[float]:
        """Joint torque, n floats [N m]; held until the next cycle.

        Raises:
            HricError: the law cannot go on; the run ends with this text.
        """
        raise NotImplementedError
