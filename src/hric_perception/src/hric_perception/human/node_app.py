"""Node `emulated_human`: the hand, the Motive that measures it, and topics with the true motion."""

import threading
from dataclasses import dataclass, replace
from time import sleep
from typing import Any

from std_srvs.srv import Trigger, TriggerResponse

from franka_msgs.msg import FrankaState
from hric_core.errors import HricError
from hric_core.parameters import Settings, anything, text
from hric_core.robot_time.follower import RobotTime
from hric_core.robot_time.progress import ProgressReport
from hric_core.robot_time.stream_time import Clock
from hric_core.ros import RosNode
from hric_core.ros.process import NodeApp
from hric_perception.emulation import SEED
from hric_perception.human.motion_capture import see
from hric_perception.human.truth import RATE, Truth
from hric_perception.sent import SentCounts
from hric_perception.simulated import HUMAN, PERSON, KnownTime, follow_events, follow_joints
from mocap_natnet.client.settings import address
from mocap_natnet.server import MotiveServer

MIN_SLEEP = 2e-4
"""Time between checks if a pose is due [s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class EmulatedHumanSettings(Settings):
    """Parameters of the node; the mappings are read by `see`."""

    human: Any = anything({}, default_text="`{program: sinusoid}`", text="how the hand moves, see below")
    stream: Any = anything({}, text="how Motive streams, see below")
    base_from_mocap: Any = anything(
        None,
        default_text="identity",
        text="`xyz` [m], `xyzw`: pose of the mocap frame, turned to z up, in the base, as `natnet_client` has it",
    )
    person: Any = PERSON
    world_from_base: Any = anything(
        None,
        default_text="identity",
        text="`xyz` [m], `xyzw`: pose of the base in the world, in which `person` is",
    )
    base_frame: str = text("panda_link0", text="frame of `hric/human/hand`, in which the program moves")
    seed: int = SEED
    ip: str = address("127.0.0.1", "address to listen on", empty=False)
    state_topic: str = text(
        "", text="of the robot; empty: `franka_state_controller/franka_states` in the node's namespace"
    )


class HumanNode(NodeApp):
    """Emulated human that streams from construction on; the hand moves from `~start` on.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or the port is in use.
    """

    def __init__(self, node: RosNode) -> None:
        human_settings = EmulatedHumanSettings.read(node)
        seen = see(
            human_settings.human,
            human_settings.stream,
            human_settings.base_from_mocap,
            human_settings.seed,
            f"{node.namespace}/",
            human_settings.person,
            human_settings.world_from_base,
        )
        seen.motive.settings = settings = replace(seen.motive.settings, ip=human_settings.ip)
        self._hand, self._body, self._truth = seen.hand, seen.body, Truth(node, seen.hand, human_settings.base_frame)
        self._robot_time = RobotTime(node)
        clock: Clock = self._robot_time
        self._behind = 0.0
        if (body := seen.body) is not None:
            # A frame goes out when its latency is over and what it shows is known; its truth is known no earlier.
            self._behind, states = settings.latency, body.states
            clock = KnownTime(clock, lambda: states.known, self._behind)
            follow_joints(node, states.add)
            follow_events(node, self._on_event)
        self._progress = ProgressReport(node)
        self._server = MotiveServer(seen.motive, clock, self._progress.reached)
        if body is not None:
            body.robot_time = self._server.robot_time
        self._counts = SentCounts(node, "", "frames", settings.rate)
        node.subscribe(
            node.beside(human_settings.state_topic or "franka_state_controller/franka_states"),
            FrankaState,
            self._on_state,
            queue_size=1,
        )
        node.service("start", Trigger, self._on_start)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._publish_truth, name="truth", daemon=True)
        self._server.start()
        self._thread.start()
        waits = f"waits for {node.resolve('start')}" if body is None else "is that of the human in the robot's plant"
        node.log_info(f"{seen.name} streams at {settings.rate:g} Hz by {settings.transport} and {waits}")

    def tick(self) -> None:
        """Check that the run is paced, once a second.

        Raises:
            HricError: the run is not paced.
        """
        self._robot_time.tick()

    def close(self) -> None:
        """Stop streaming."""
        self._stop.set()
        self._thread.join(1.0)
        self._server.close()
        self._progress.close()
        self._robot_time.close()

    def _publish_truth(self) -> None:
        while not self._stop.is_set():
            time = self._server.time
            began = self._server.robot_time(0.0)
            if began is None:
                sleep(0.5 / RATE)
                continue
            if time >= self._behind:
                self._truth.advance(time - self._behind, began)
            latest, sent = self._server.progress
            self._counts.publish(latest + 1, sent, began + latest / self._server.motive.settings.rate)
            sleep(max(self._server.wait(self._truth.next + self._behind), MIN_SLEEP))

    def _on_state(self, message: Any) -> None:
        began = self._server.robot_time(0.0)
        if began is not None:
            x, y, z = message.O_T_EE[12:15]
            self._hand.see(message.header.stamp.to_sec() - began, (x, y, z))

    def _on_event(self, time: float, kind: str) -> None:
        """Store an event of the human in the robot's plant."""
        assert self._body is not None
        self._body.happened(time, kind)
        if kind == "started":
            self._truth.started(time)

    def _on_start(self, _: Any) -> Any:
        if self._body is not None:
            return TriggerResponse(success=True, message=f"the human in the plant begins with hric/{HUMAN}/start")
        began = self._server.robot_time(0.0)
        if began is None:
            return TriggerResponse(success=False, message="robot time is not known yet")
        time = self._server.time
        try:
            zero = self._hand.start(time)
        except HricError as error:
            return TriggerResponse(success=False, message=str(error))
        self._truth.started(began + zero)
        return TriggerResponse(success=True, message=f"the hand starts at {began + time:.3f} s")
