"""Node `emulated_human`: a moving hand, the emulated Motive that measures it, and topics with its true motion."""

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
"""Shortest time between checks whether a true pose is due [s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class EmulatedHumanSettings(Settings):
    """Parameters of the node `emulated_human`; the function `see` reads the mappings."""

    human: Any = anything({}, default_text="`{program: sinusoid}`", text="how the hand moves, see below")
    stream: Any = anything({}, text="settings and faults of Motive's stream, see below")
    base_from_mocap: Any = anything(
        None,
        default_text="identity",
        text="`xyz` [m], `xyzw`: pose of the mocap frame, turned to z up, in the base, as for `natnet_client`",
    )
    person: Any = PERSON
    world_from_base: Any = anything(
        None,
        default_text="identity",
        text="`xyz` [m], `xyzw`: pose of the base in the world, in which `person` is placed",
    )
    base_frame: str = text("panda_link0", text="frame of `hric/human/hand`, in which the program moves")
    seed: int = SEED
    ip: str = address("127.0.0.1", "address to listen on", empty=False)
    state_topic: str = text(
        "", text="topic of the robot's state; empty: `franka_state_controller/franka_states` in the node's namespace"
    )


class HumanNode(NodeApp):
    """Node of an emulated human: it streams from construction on; the hand moves once the service `~start` is called.

    Args:
        node: private node.

    Raises:
        HricError: a parameter is not valid, or the UDP port is in use.
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
            # A frame is sent after its latency, once the measured motion is known. The true pose is not known earlier.
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
        start = f"rests until {node.resolve('start')} is called" if body is None else "belongs to the simulated human"
        node.log_info(f"streaming {seen.name} at {settings.rate:g} Hz by {settings.transport}; it {start}")

    def tick(self) -> None:
        """Check once a second that the run is paced, that is, held to a real-time factor.

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
        """Store an event of the simulated human, and publish the start of their motion."""
        assert self._body is not None
        self._body.happened(time, kind)
        if kind == "started":
            self._truth.started(time)

    def _on_start(self, _: Any) -> Any:
        if self._body is not None:
            return TriggerResponse(success=True, message=f"no effect: hric/{HUMAN}/start starts the simulated human")
        began = self._server.robot_time(0.0)
        if began is None:
            return TriggerResponse(success=False, message="not started: robot time is not known yet")
        time = self._server.time
        try:
            zero = self._hand.start(time)
        except HricError as error:
            return TriggerResponse(success=False, message=str(error))
        self._truth.started(began + zero)
        return TriggerResponse(success=True, message=f"the hand starts at {began + time:.3f} s of robot time")
