"""The node `emulated_human`: his hand, the Motive that sees it, and on topics what it really does."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from time import sleep
from typing import Any

import rospy
from std_msgs.msg import Header
from std_srvs.srv import Trigger, TriggerResponse

from franka_msgs.msg import FrankaState
from hric_control import stamps
from hric_control.errors import HricError, ParameterError
from hric_control.ros_node import RosNode
from hric_perception.human.motion_capture import see
from hric_perception.human.truth import RATE, Truth
from hric_perception.replayed import START_TOPIC
from hric_perception.sent import SentCounts
from mocap_natnet import messages
from mocap_natnet.process import run
from mocap_natnet.run_time import RunTime
from mocap_natnet.server import MotiveServer

LEAST_SLEEP = 2e-4
"""Between two looks at whether a pose is due [s] (our choice)."""


class HumanNode:
    """Streams from its construction on; the hand moves from `~start` on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or the port is taken.
    """

    def __init__(self, node: RosNode) -> None:
        seed, frame, topic = (node.param(name, default) for name, default in (("seed", 0), ("base_frame", "panda_link0"), ("state_topic", "")))
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise ParameterError(f"{node.resolve('seed')} is {seed!r}; valid: a whole number, 0 or more")
        human, stream, base = (node.param(name, None) for name in ("human", "stream", "base_from_mocap"))
        seen = see(human, stream, base, seed, f"{node.namespace}/")
        seen.motive.settings = settings = replace(seen.motive.settings, ip=str(node.param("ip", seen.motive.settings.ip)))
        self._hand, self._truth = seen.hand, Truth(node, seen.hand, str(frame))
        self._run_time = RunTime(node)
        self._server = MotiveServer(seen.motive, self._run_time)
        self._counts = SentCounts(node, "", "frames", settings.rate)
        node.subscribe(str(topic) or f"{rospy.get_namespace()}franka_state_controller/franka_states", FrankaState, self._on_state, queue_size=1)
        self._started = node.advertise(START_TOPIC, Header, latch=True)
        node.service("start", Trigger, self._on_start)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._tell, name="truth", daemon=True)
        self._server.start()
        self._thread.start()
        node.log_info(f"{seen.name} streams at {settings.rate:g} Hz by {settings.transport} and waits for {node.resolve('start')}")

    def tick(self) -> None:
        """Once a second.

        Raises:
            HricError: the run is not paced.
        """
        self._run_time.tick()

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._thread.join(1.0)
        self._server.close()
        self._run_time.close()

    def _tell(self) -> None:
        while not self._stop.is_set():
            time = self._server.time
            began = self._server.run_time(0.0)
            if began is None:
                sleep(0.5 / RATE)
                continue
            self._truth.advance(time, began)
            latest, sent = self._server.progress
            self._counts.tell(latest + 1, sent, began + latest / self._server.motive.settings.rate)
            sleep(max(self._server.wait(self._truth.next), LEAST_SLEEP))

    def _on_state(self, message: Any) -> None:
        began = self._server.run_time(0.0)
        if began is not None:
            x, y, z = message.O_T_EE[12:15]
            self._hand.see(message.header.stamp.to_sec() - began, (x, y, z))

    def _on_start(self, _: Any) -> Any:
        began = self._server.run_time(0.0)
        if began is None:
            return TriggerResponse(success=False, message="the time of the run is not known yet")
        time = self._server.time
        try:
            zero = self._hand.start(time)
        except HricError as error:
            return TriggerResponse(success=False, message=str(error))
        self._started.publish(messages.header(stamps.to_time(began + zero), ""))
        return TriggerResponse(success=True, message=f"the hand starts at {began + time:.3f} s")


def main(text: str) -> int:
    """Run the node; text: for --help. Returns the exit code."""

    def make(node: RosNode) -> tuple[Callable[[], None], Callable[[], None]]:
        human = HumanNode(node)
        return human.tick, human.close

    return run("emulated_human", text, make)
