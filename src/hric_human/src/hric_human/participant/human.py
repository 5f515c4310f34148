"""Simulated human in the robot's plant: the plugin `hric_human/Human`."""

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from std_srvs.srv import Trigger, TriggerResponse

from hric_control.plant import Articulated, Contact, Plant
from hric_control.sim.participants import Participant
from hric_core import realtime
from hric_core.errors import CommandError, HricError, UnknownNameError
from hric_core.geometry import ORIGIN, Vector
from hric_core.node import Node
from hric_core.parameters import below
from hric_human.body import surfaces
from hric_human.contact import RegionContact, RegionContacts
from hric_human.control import HumanControl
from hric_human.participant.grip import Grip
from hric_human.participant.settings import HAND, MUSCLE, HumanSettings
from hric_human.participant.topics import Topics
from hric_human.participant.walk import Walk

if TYPE_CHECKING:
    from hric_human.participant.muscles import HumanMuscles

SERVICE_TIMEOUT = 5.0
"""Maximum time that a service call waits for the control loop [s of wall time] (project default, unconfirmed)."""
SIGHT_PERIOD = 0.01
"""Time between two observations of the robot by the person [s] (project default, unconfirmed)."""


class Human(Participant):
    """Simulated human, present in the plant from construction on.

    The person stays in their controller's initial posture until the service `hric/NAME/start` starts the motion.

    Raises:
        HricError: a parameter is invalid, or models of the plant cannot have joints.
    """

    def __init__(self, name: str, plant: Plant, node: Node, config: Mapping[str, object]) -> None:
        where = f"{node.resolve('participants')}/{name}"
        self._settings = settings = HumanSettings.of(config, where)
        if not isinstance(plant, Articulated):
            raise HricError(
                f"{where}: a simulated human needs a plant whose models can have joints; those of "
                f"{type(plant).__name__} cannot"
            )
        self._name, self._where, self._plant, self._node = name, where, plant, node
        self._body = settings.body()
        self._root = settings.root(self._body)
        self._message_cycles = max(1, round(1.0 / (settings.rate * plant.time_step)))
        self._sight_cycles = max(1, round(SIGHT_PERIOD / plant.time_step))
        self._control = self._new_control()
        walk = settings.walk
        self._walk = None if walk is None else Walk(walk, self._body, settings.heading)
        urdf = self._body.urdf if self._walk is None else self._walk.urdf
        plant.spawn(name, urdf, self._root.transform(), fixed=True, surfaces=surfaces(self._body, settings.contact_law))
        self._requests: deque[tuple[Future[str], Callable[[], object]]] = deque()
        self._topics = Topics(node, name, self._control.person, self._root, walks=walk is not None)
        self._hand = f"{name}::{self._body.segments[f'{self._control.person.hand.side}_hand'].link}"
        self._grips = [self._new_grip(grip) for grip in settings.grips]
        self._feeling = [grip for grip in self._grips if settings.grips[grip.name].holder == HAND]
        self._muscles = self._new_muscles()
        with self._naming("watches"):
            if settings.watches:
                plant.link_state(settings.watches)
        where, calls = f"{node.beside('hric')}/{name}", dict[str, Callable[[], object]](start=self._start)
        for grip in self._grips:
            calls[f"grips/{grip.name}/close"] = grip.close
            calls[f"grips/{grip.name}/open"] = partial(grip.open, "the service to open it was called")
        self._services = [node.service(f"{where}/{path}", Trigger, self._served(act)) for path, act in calls.items()]
        self._begin()

    def _new_control(self) -> HumanControl:
        settings, plant = self._settings, self._plant
        x, y, z = plant.gravity
        where = f"{below(self._where)}control"
        return HumanControl(self._body, settings.control, settings.seed, self._root, (x, y, z), plant.time_step, where)

    def _new_muscles(self) -> "HumanMuscles | None":
        if self._settings.drive != MUSCLE:
            return None
        from hric_human.participant.muscles import HumanMuscles  # imported only for a body with muscles

        x, y, z = self._plant.gravity
        where, person = f"{below(self._where)}muscles.", self._control.person
        return HumanMuscles(
            self._node, self._name, person, self._root, (x, y, z), self._settings.muscles, where, self._happened
        )

    def _new_grip(self, name: str) -> Grip:
        settings, hand = self._settings.grips[name], self._control.person.hand
        holder, palm = settings.holder, settings.palm
        if holder == HAND:
            holder = self._hand
            x, y, z = (a + b for a, b in zip(palm, hand.p_link_hand, strict=True))
            palm = x, y, z
        with self._naming(f"grips/{name}"):
            return Grip(name, settings, self._plant, holder, palm, self._happened)

    @contextmanager
    def _naming(self, key: str) -> Iterator[None]:
        """Add the parameter's key to an UnknownNameError that the plant raises."""
        try:
            yield
        except UnknownNameError as error:
            raise UnknownNameError(error.kind, error.name, error.valid, f"{below(self._where)}{key}") from None

    # -- the loop ------------------------------------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset the person to the initial state, with the parameter `seed` as it is now, and wait for `start`."""
        seed = self._node.param(f"participants/{self._name}/seed", self._settings.seed)
        if self._cycles or seed != self._control.person.seed:  # otherwise the person has not acted yet
            self._control.restart(seed)
        for grip in self._grips:
            grip.restart()
        if self._muscles is not None:
            self._muscles.restart()
        self._begin()

    def _begin(self) -> None:
        n = len(self._control.person.joints)
        self._q, self._dq = [0.0] * n, [0.0] * n
        walked = [] if self._walk is None else self._walk.start
        self._all_q, self._all_dq = [0.0] * (n + len(walked)), [0.0] * (n + len(walked))
        self._called, self._zero, self._cycles, self._time = False, math.inf, 0, 0.0
        self._end = self._control.end or math.inf  # a motion that only stays in place has no end
        self._strained = self._control.at_strength
        self._contacts, self._ended = RegionContacts(self._body, self._name), list[RegionContact]()
        self._plant.set_joints(self._name, [*walked, *self._control.posture])

    def act(self, time: float) -> None:
        """Read the contact forces, compute the control, and drive the joints for the coming step."""
        self._time = time
        while self._requests:
            self._serve(*self._requests.popleft())
        if self._called:
            self._begin_motion(time)
        plant, q, dq, since = self._plant, self._q, self._dq, max(time - self._zero, 0.0)
        if since >= self._end:
            self._end = math.inf
            self._happened("ended", self._name, 0.0, f"the motion has ended, {since:.3f} s after its start")
        for grip in self._grips:
            grip.step(time, since)
        self._read()
        if self._settings.watches and self._cycles % self._sight_cycles == 0:
            x, y, z = plant.link_state(self._settings.watches)[0][:3, 3].tolist()
            self._control.see(time, (x, y, z))
        contacts = plant.contacts()
        self._ended += self._contacts.update(time, contacts)
        tau = self._control.update(time, q, dq, self._felt(contacts))
        if self._muscles is not None:
            tau = self._muscles.torque(q, dq, tau)
        walked = [] if self._walk is None else self._walk.force(time - self._zero, self._all_q[:2], self._all_dq[:2])
        plant.drive_joints(self._name, [*walked, *tau])
        if self._control.at_strength is not self._strained:
            self._note_strength()
        if self._cycles % self._message_cycles == 0:
            stamp, angles, speeds = self.epoch + time, q[:], dq[:]
            self._topics.publish(stamp, angles, speeds, tau, self._control, self._grips)
            if self._walk is not None:
                self._topics.publish_root(stamp, self._walk.root(self._root, self._all_q))
            if self._muscles is not None:
                self._muscles.publish(stamp, angles, speeds, self._grips, contacts)
            self._topics.publish_contacts(stamp, self.epoch, self._contacts.present.values(), self._ended)
            self._ended = []
        self._cycles += 1

    def _read(self) -> None:
        """Read the joint state of the body; the first two joints of a walking person only move the root link."""
        if self._walk is None:
            self._plant.read_joints(self._name, self._q, self._dq)
            return
        self._plant.read_joints(self._name, self._all_q, self._all_dq)
        self._q[:], self._dq[:] = self._all_q[-len(self._q) :], self._all_dq[-len(self._q) :]

    def _begin_motion(self, time: float) -> None:
        self._called, self._zero = False, time
        self._control.start(time)
        self._happened("started", self._name, 0.0, f"the motion starts at {time:.3f} s")

    def _felt(self, contacts: Sequence[Contact]) -> Vector:
        """Return the total force on the hand from its grips and its elastic contacts [N]."""
        forces = [grip.load.force for grip in self._feeling if grip.closed]
        for contact in contacts:
            if contact.kind == "penalty" and self._hand in (contact.body_a, contact.body_b):
                force = contact.force if contact.body_a == self._hand else -contact.force
                a, b, c = contact.normal
                forces.append((force * a, force * b, force * c))
        if len(forces) < 2:
            return forces[0] if forces else ORIGIN
        x, y, z = map(sum, zip(*forces, strict=True))
        return x, y, z

    def _note_strength(self) -> None:
        before, now, control = self._strained, self._control.at_strength, self._control
        for joint, was, is_now in zip(control.person.joints, before, now, strict=True):
            if is_now and not was:
                text = f"{joint} has reached its maximum strength ({control.clipped[joint]} times so far)"
                self._happened("strength", joint, float(control.clipped[joint]), text)
        self._strained = now

    def _happened(self, kind: str, name: str, value: float, text: str) -> None:
        self._topics.event(self.epoch + self._time, kind, name, value, text)
        if not self._node.publishes_inline:  # a headless run lists the events in its report instead
            realtime.defer(self._node, partial(self._node.log_info, f"{self._name}: {text}"))

    # -- services ------------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        if self._called or self._zero < math.inf:
            raise CommandError(
                f"the motion of {self._name} has already started at {self._zero:.3f} s; it can be started again only "
                "after a reset of the simulation"
            )
        self._called = True

    def _served(self, act: Callable[[], object]) -> Callable[[Any], Any]:
        """Return a service handler that calls `act` inside the loop, between two cycles."""

        def handler(_: Any) -> Any:
            done: Future[str] = Future()
            self._requests.append((done, act))
            if self._node.publishes_inline:
                self._serve(*self._requests.pop())
            try:
                return TriggerResponse(success=True, message=done.result(SERVICE_TIMEOUT))
            except TimeoutError:
                return TriggerResponse(
                    success=False,
                    message=f"the control loop has not advanced for {SERVICE_TIMEOUT:g} s; the request stays queued",
                )
            except HricError as error:
                return TriggerResponse(success=False, message=str(error))

        return handler

    def _serve(self, done: "Future[str]", act: Callable[[], object]) -> None:
        try:
            act()
            done.set_result(f"at {self._time:.3f} s")
        except HricError as error:
            done.set_exception(error)

    def close(self) -> None:
        """Remove topics and services."""
        for service in self._services:
            service.unregister()
        self._topics.close()
        if self._muscles is not None:
            self._muscles.close()
