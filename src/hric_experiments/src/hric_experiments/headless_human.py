"""The emulated human, the Motive that sees him and the client that tells of it, in the process of a headless run: no sockets, the same codec."""

from __future__ import annotations

from typing import Any

from franka_msgs.msg import FrankaState
from hric_control.local_node import LocalNode
from hric_experiments.mocap_spec import MocapSpec
from hric_experiments.parameters import EMULATED_HUMAN, MOCAP_CLIENT
from hric_perception.human.truth import Truth
from mocap_natnet.headless import HeadlessMocap, run_time
from mocap_natnet.parameters import read_publishing
from mocap_natnet.publisher import MocapPublisher

STATE_TOPIC = "franka_state_controller/franka_states"


class HeadlessHuman:
    """Moves with run time; the program's time 0 is the first `advance`.

    Args:
        node: the robot's namespace, with the parameters of the motion capture's nodes.
        spec: the experiment's section.
        seed: of all that is random.

    Raises:
        HricError: a parameter that does not suit a run without a network.
    """

    def __init__(self, node: LocalNode, spec: MocapSpec, seed: int) -> None:
        seen = spec.build(seed)
        self._hand, self._started = seen.hand, False
        publisher = MocapPublisher(node, read_publishing(node.child(MOCAP_CLIENT)), run_time)
        self._mocap = HeadlessMocap(seen.motive, publisher)
        self._truth = Truth(node, seen.hand, node.param(f"{EMULATED_HUMAN}/base_frame"))
        node.subscribe(STATE_TOPIC, FrankaState, self._on_state)

    def _on_state(self, message: Any) -> None:
        x, y, z = message.O_T_EE[12:15]
        self._hand.see(message.header.stamp.to_sec(), (x, y, z))

    def advance(self, time: float) -> None:
        """Go on to a time of the run [s]."""
        if not self._started:
            self._started = True
            self._hand.start(time)
        self._mocap.advance(time)
        self._truth.advance(time)
