"""True motion of the emulated human on topics, in addition to the measured motion."""

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Header, String

from hric_core.geometry import stamped
from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_human.hand import Hand
from hric_perception.replayed import START_TOPIC

RATE = 100.0
"""Rate of the hand's true pose [Hz of robot time]."""


class Truth:
    """Publisher of the hand at RATE, its phase on change, and the start, below `hric/human`; called from one thread.

    Args:
        node: node that publishes.
        hand: hand of the human.
        frame: frame of the poses: the robot's base.
        announced: True: publish the start, for sensors that replay a trial in step.
    """

    def __init__(self, node: Node, hand: Hand, frame: str, announced: bool = True) -> None:
        self._hand, self._frame, self._published = hand, frame, ""
        self._poses = node.advertise(node.beside("hric/human/hand"), PoseStamped, queue_size=100)
        self._phases = node.advertise(node.beside("hric/human/phase"), String, queue_size=10, latch=True)
        self._starts = node.advertise(node.beside(START_TOPIC), Header, latch=True) if announced else None
        self._next: int | None = None

    def started(self, time: float) -> None:
        """Publish the start of the motion, time of the run [s]; from any thread."""
        if self._starts is not None:
            self._starts.publish(stamped.header(stamps.to_time(time), ""))

    @property
    def next(self) -> float:
        """Time at which the next pose is due, on the hand's clock [s]."""
        return (self._next or 0) / RATE

    def advance(self, time: float, offset: float = 0.0) -> None:
        """Publish the pose that is due on the time grid of RATE; of several due poses only the newest.

        Args:
            time: time on the hand's clock [s].
            offset: robot time minus time on the hand's clock [s].
        """
        due = int(time * RATE + 1e-6)
        if self._next is not None and due < self._next:
            return
        self._next, time = due + 1, due / RATE
        phase = self._hand.phase(time)
        if phase != self._published:
            self._published = phase
            self._phases.publish(String(phase))
        if not self._poses.subscribers():
            return
        head = stamped.header(stamps.to_time(time + offset), self._frame)
        self._poses.publish(stamped.pose_stamped(head, self._hand(time)))
