"""True motion of the emulated human on topics, in addition to the measured motion."""

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

from hric_core.geometry import stamped
from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_human.hand import Hand

RATE = 100.0
"""Rate of the hand's true pose [Hz of robot time]."""


class Truth:
    """Publisher of the hand's true pose at RATE, and of the phase of its motion on change; called from one thread.

    Args:
        node: node that publishes.
        hand: hand of the human.
        frame: frame of the poses: the robot's base.
    """

    def __init__(self, node: Node, hand: Hand, frame: str) -> None:
        self._hand, self._frame, self._published = hand, frame, ""
        self._poses = node.advertise(node.beside("hric/human/hand"), PoseStamped, queue_size=100)
        self._phases = node.advertise(node.beside("hric/human/phase"), String, queue_size=10, latch=True)
        self._next: int | None = None

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
