"""Supervisor as an application: parameters, topics and decisions, on a ROS master or in a headless run."""

import math
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from visualization_msgs.msg import MarkerArray

from controller_manager_msgs.srv import (
    ListControllers,
    ListControllersRequest,
    SwitchController,
    SwitchControllerRequest,
)
from hric_control.plants import rotor_inertia
from hric_control.speed_scale import SpeedScaleInterface
from hric_control.speed_scale_topics import REQUEST_TOPIC, STATE_TOPIC
from hric_control.transmission import parse_transmissions
from hric_core.errors import HricError, ParameterError
from hric_core.node import Node
from hric_msgs.msg import SafetyEvent, SafetyState, SpeedScale, SpeedScaleState
from hric_supervisor import topics
from hric_supervisor.arm import ArmShape, InForce
from hric_supervisor.decision import Decision, DecisionEvent, Supervisor
from hric_supervisor.inputs import ArmInput, person_inputs
from hric_supervisor.settings import SupervisorNodeSettings

NAME = "hric/safety/supervisor"
"""Name of the supervisor's node, below the robot's namespace; its topics are in hric/safety."""
SILENCE = 10.0
"""Number of missed decisions after which the robot stops by itself (project default, unconfirmed)."""
MARKERS_PERIOD = 0.05
"""Period of the markers for rviz [s]."""
CONTROLLERS_PERIOD = 0.25
"""Period at which running controllers are checked [s] (project default, unconfirmed)."""
WARNED = ("fault", "violation", "holder_lost")
"""Event kinds that are logged as warnings."""
KEPT = 100_000
"""Maximum number of stored latencies: decisions of a quarter of an hour."""
Call = Callable[[str, type, Any], Any]
"""Function (absolute name, type, request) -> response of a service."""


class SupervisorApp:
    """Supervisor that subscribes to arm and persons, decides when `decide` is called, and publishes the decision.

    Args:
        node: node of the supervisor, with private names.
        call: function that calls a service.

    Attributes:
        settings: parameters of the node.
        latencies: delays from the stamp of a person's pose to the robot cycle that first obeyed a lower speed scale
            [s].

    Raises:
        HricError: a parameter is invalid, or the arm is real and `acknowledge_no_safety_function` is not set.
    """

    def __init__(self, node: Node, call: Call) -> None:
        self._node, self._call = node, call
        self._root = root = robot_namespace(node.namespace)
        self.settings = settings = SupervisorNodeSettings.read(node)
        self._check_arm()
        description = node.param(f"{root}robot_description")
        joints = [transmission.joint for transmission in parse_transmissions(description)]
        arm = ArmShape(description, joints)
        rotors = np.array(rotor_inertia(node.param(f"{root}robot/plant", {}), joints, arm.tree))
        base = arm.tree.joints[joints[0]].parent
        self._arm = ArmInput(node, root, joints)
        self._persons = person_inputs(node, root, settings, base)
        T = arm.poses(np.zeros((1, len(joints))))
        frames = {person.frame: T[person.frame][0] if person.frame in T else np.eye(4) for person in self._persons}
        self._supervisor = Supervisor(self.settings, arm, rotors, frames)
        self._state = node.advertise(f"{root}hric/safety/state", SafetyState)
        self._events = node.advertise(f"{root}hric/safety/events", SafetyEvent, queue_size=100)
        self._markers = node.advertise(f"{root}hric/safety/markers", MarkerArray)
        self._requests = node.advertise(f"{root}{REQUEST_TOPIC}", SpeedScale)
        self._in_force = InForce()
        self._taken = node.subscribe(f"{root}{STATE_TOPIC}", SpeedScaleState, self._on_taken)
        self.latencies: deque[float] = deque(maxlen=KEPT)
        self._slower: dict[int, bool] = {}
        self._scale, self._latency, self._markers_at = 1.0, math.nan, -math.inf
        self._lock, self._sending = threading.Lock(), threading.Lock()
        self._outgoing: deque[Callable[[], None]] = deque()
        self._refused: set[str] = set()
        self._holder = self._holder_reported = ("", False)

    def _check_arm(self) -> None:
        address = str(self._node.param(f"{self._root}robot/robot_ip", ""))
        if address and not address.startswith("127.") and not self.settings.acknowledge_no_safety_function:
            raise ParameterError(
                f"the arm at {address} may be real, and this supervisor is not a certified safety function: it does "
                "not replace the protective stop of the cell. Valid: an address 127.* (emulated arm), or "
                f"{self._node.resolve('acknowledge_no_safety_function')}: true"
            )

    def on_person(self, came: Callable[[], None]) -> None:
        """Call `came` for each new pose of a person, in the thread that received it."""
        for person in self._persons:
            person.came = came

    # -- deciding ------------------------------------------------------------------------------------------------------

    def decide(self, now: float) -> Decision:
        """Decide at robot time `now` [s] and publish the decision; callable from any thread, one at a time decides."""
        with self._lock:
            person, *others = [person.take() for person in self._persons]
            decision = self._supervisor.decide(now, self._arm.take(), person, self._in_force, others)
            if self.settings.active:
                self._request(decision)
            self._later(self._state.publish, topics.state(decision, self.settings, self._latency))
            self._report(decision, [*decision.events, *self._of_holders()])
            if not 0.0 <= now - self._markers_at < MARKERS_PERIOD and self._markers.subscribers():
                self._markers_at = now
                self._later(self._markers.publish, topics.markers(decision))
        self._send()
        return decision

    def _later(self, act: Callable[[Any], None], argument: Any) -> None:
        """Queue a publication or log line, to be sent by `_send` when no lock is held."""
        self._outgoing.append(lambda: act(argument))

    def _send(self) -> None:
        """Send the queued items in order; return at once if another thread is sending."""
        while self._outgoing and self._sending.acquire(blocking=False):
            try:
                while self._outgoing:
                    self._outgoing.popleft()()
            finally:
                self._sending.release()

    def _request(self, decision: Decision) -> None:
        message = topics.request(decision, SILENCE / self.settings.rate)
        if not decision.fault:
            if len(self._slower) > KEPT:  # happens only if no robot accepts the requests
                self._slower.clear()
            self._slower[message.header.stamp.to_nsec()] = decision.scale < self._scale
        self._scale = decision.scale
        self._later(self._requests.publish, message)

    def _report(self, decision: Decision, events: Any) -> None:
        for event in events:
            self._later(self._events.publish, topics.event(decision, event))
            if not self._node.publishes_inline:  # a headless run lists the events in its report
                self._later(self._node.log_warn if event.kind in WARNED else self._node.log_info, event.text)

    def _of_holders(self) -> list[DecisionEvent]:
        """Return an event if, since the last call, another node began to limit the speed, or such a node was lost."""
        (holder, lost), before = self._holder, self._holder_reported
        self._holder_reported = self._holder
        if self._holder == before or not holder or (holder == self._node.namespace and not lost):
            return []
        if lost:
            return [
                DecisionEvent("holder_lost", f"{holder} requested no speed scale in time: the arm stops until it does")
            ]
        return [DecisionEvent("held", f"{holder} limits the speed: it requests a lower scale than the supervisor")]

    def _on_taken(self, message: Any) -> None:
        """Store the speed scale that the robot now obeys, and the latency since the measurement of the person."""
        self._holder = message.holder, message.expired
        self._in_force = InForce(message.header.stamp.to_sec(), message.requested, message.scale)
        slower = self._slower.pop(message.request.to_nsec(), None)
        if slower is None or message.expired:
            return
        self._latency = message.header.stamp.to_sec() - message.request.to_sec()
        if slower:
            self.latencies.append(self._latency)

    # -- controllers ---------------------------------------------------------------------------------------------------

    def stop_others(self, now: float) -> None:
        """Stop all controllers that command an arm but do not declare to obey the speed scale; now: robot time [s].

        Those of several arms have a manager for each arm, and one for all.
        """
        if self.settings.active:
            for arm in ("", *(f"{name}/" for name in self._node.param(f"{self._root}robot/arms", ()))):
                self._stop_others_of(arm, now)

    def _stop_others_of(self, arm: str, now: float) -> None:
        manager = f"{self._root}{arm}controller_manager"
        listed = self._call(f"{manager}/list_controllers", ListControllers, ListControllersRequest())
        running = [controller for controller in listed.controller if controller.state == "running"]
        others = [controller.name for controller in running if not _obeys(controller)]
        if not others:
            return
        request = SwitchControllerRequest(stop_controllers=others, strictness=SwitchControllerRequest.BEST_EFFORT)
        done = self._call(f"{manager}/switch_controller", SwitchController, request)
        names = ", ".join(f"{arm}{name}" for name in others)
        text = f"controller {names} commands the arm and does not obey the speed scale: " + (
            "it was stopped" if done.ok else "IT COULD NOT BE STOPPED"
        )
        if done.ok or names not in self._refused:
            self._refused.add(names)
            nothing = Decision(now, math.nan, "", math.nan)
            self._report(nothing, [DecisionEvent("controller_stopped" if done.ok else "fault", text)])
            self._send()

    # -- the end -------------------------------------------------------------------------------------------------------

    def latency_text(self) -> str:
        """Return median and 99th percentile of the latencies as text."""
        if not self.latencies:
            return "the supervisor has not slowed the arm"
        median, late = np.percentile(np.array(self.latencies), [50, 99])
        return (
            f"latency from the measurement of the person to the slowing arm: median {1e3 * median:.1f} ms, 99th "
            f"percentile {1e3 * late:.1f} ms ({len(self.latencies)} slow-downs)"
        )

    def close(self) -> None:
        """Unregister all topics; a supervised robot then receives no more requests and stops by itself."""
        of_persons = [registration for person in self._persons for registration in person.registrations]
        for registration in (*self._arm.registrations, *of_persons, self._taken):
            registration.unregister()
        for publisher in (self._state, self._events, self._markers, self._requests):
            publisher.unregister()


class HeadlessSupervisor(SupervisorApp):
    """Supervisor of a headless run, which decides at its rate in robot time.

    Args:
        node: node of the supervisor, with private names.
        call: function that calls a service.

    Attributes:
        last: last decision; None before the first.
    """

    def __init__(self, node: Node, call: Call) -> None:
        super().__init__(node, call)
        self.last: Decision | None = None
        self._next = self._look = 1.0 / self.settings.rate

    def advance(self, time: float) -> None:
        """Advance to robot time `time` [s], and decide if a decision is due."""
        if time >= self._look:
            self._look = time + CONTROLLERS_PERIOD
            self.stop_others(time)
        if time >= self._next - 1e-9:
            self._next += 1.0 / self.settings.rate
            self.last = self.decide(time)


def robot_namespace(namespace: str) -> str:
    """Return the robot's namespace with a trailing slash; namespace: of the node, `<robot>/hric/safety/supervisor`."""
    end = f"/{NAME}"
    if not namespace.endswith(end):
        raise HricError(f"the supervisor's node is named {namespace}; valid: {NAME} below the robot's namespace")
    return namespace.removesuffix(end) + "/"


def _obeys(controller: Any) -> bool:
    claims = {claimed.hardware_interface: claimed.resources for claimed in controller.claimed_resources}
    return SpeedScaleInterface.cpp_name in claims or not any(claims.values())
