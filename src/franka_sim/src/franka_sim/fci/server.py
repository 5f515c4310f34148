"""Network server of the emulated robots in one world. One thread with one selector, which no client can block."""

import selectors
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from franka_sim.fci.arm_service import ArmService
from franka_sim.fci.clock import PERIOD, CycleClock, MotionPhase, make_clock
from franka_sim.fci.device import Device
from franka_sim.fci.faults import NetworkFaults
from franka_sim.fci.hand_service import STEP, HandService, tool_service
from franka_sim.fci.protocol import PROTOCOLS
from franka_sim.fci.session import Service
from hric_core.errors import UnknownNameError

LONGEST_WAIT = 0.05
"""Maximum wait for the sockets [s]; a signal or `stop` takes effect within it."""
CYCLES_PER_STEP = round(STEP / PERIOD)


@dataclass(frozen=True)
class FciArm:
    """Emulated robot, with address and protocol of its control box.

    Attributes:
        device: the emulated robot.
        ip: address to listen on; the ports are libfranka's (1337, with a hand 1338, with a vacuum gripper 1339).
        version: protocol version, 5 or 10.
    """

    device: Device
    ip: str = "127.0.0.1"
    version: int = 5


class FciServer:
    """Server that offers emulated robots to libfranka clients, as the control boxes of real arms do.

    In a cycle all robots take their commands, their world advances once, and then all send their states.

    Args:
        arms: robots of one world, in its order; a single robot may be any `Device`.
        clock: "lock_step" or "wall".
        pace: real-time factor; 0 (lock-step only): as fast as the client.
        faults: faults of the network.

    Raises:
        HricError: a port is not available, or an argument is wrong.
    """

    def __init__(
        self,
        arms: Sequence[FciArm],
        clock: str = "lock_step",
        pace: float = 1.0,
        faults: NetworkFaults | None = None,
    ) -> None:
        for version in (arm.version for arm in arms if arm.version not in PROTOCOLS):
            raise UnknownNameError("protocol version", version, map(str, PROTOCOLS), "FciServer")
        faults = faults or NetworkFaults()
        self._cycle = arms[0].device.cycle  # of the world of all arms
        self._selector = selectors.SelectSelector()  # an epoll would round the wait up to a millisecond
        self._services: list[Service] = []
        self._arms: list[ArmService] = []
        self._hands: list[HandService] = []
        self._stop = False
        self._cycles = 0
        try:
            for index, arm in enumerate(arms):
                ticks = make_clock(clock, pace, faults.loss > 0.0, alone=len(arms) == 1)
                self._serve(arm, ticks, replace(faults, seed=faults.seed + index))
        except BaseException:
            self.close()
            raise
        self._left = self._arms[0].left if len(arms) == 1 else self._until_all

    def _serve(self, arm: FciArm, clock: CycleClock, faults: NetworkFaults) -> None:
        self._arms.append(ArmService(self._selector, PROTOCOLS[arm.version], arm.device, clock, arm.ip, faults))
        self._services.append(self._arms[-1])
        if arm.device.hand is not None:
            self._hands.append(tool_service(self._selector, arm.device.hand, arm.ip, faults))
            self._services.append(self._hands[-1])

    def watch(self, file: int, callback: Callable[[int], None]) -> None:
        """Call `callback(events)` when a file descriptor is readable."""
        self._selector.register(file, selectors.EVENT_READ, callback)

    def unwatch(self, file: int) -> None:
        """Stop calling back for a file descriptor."""
        self._selector.unregister(file)

    def run(self) -> None:
        """Serve until `stop` is called."""
        while not self._stop:
            self._wait()
            self._tick()

    def stop(self) -> None:
        """Make `run` return within LONGEST_WAIT; from any thread or a signal handler."""
        self._stop = True

    def close(self) -> None:
        """Disconnect all clients and free the ports."""
        for service in self._services:
            service.close()
        self._services.clear()
        self._selector.close()

    def _wait(self) -> None:
        """Serve the sockets until the next cycle is due, at least once."""
        select, time_left = self._selector.select, self._left
        first = True
        while not self._stop:
            left = time_left(time.monotonic())
            if left <= 0.0 and not first:
                return
            first = False
            for key, events in select(min(max(left, 0.0), self._until_link())):
                key.data(events)
            self._move_links()

    def _until_all(self, now: float) -> float:
        """Return the time to wait for all arms that clients move [s]; without one, that of an arm at rest."""
        waits = [arm.left(now) for arm in self._arms if arm.phase is not MotionPhase.IDLE]
        return max(waits) if waits else self._arms[0].left(now)

    def _until_link(self) -> float:
        """Return the time until a delayed datagram of an emulated network is due, at most LONGEST_WAIT [s]."""
        left = LONGEST_WAIT
        for service in self._services:
            due = service.client.link.next_due() if service.client is not None else None
            if due is not None:
                left = min(left, max(0.0, due - time.monotonic()))
        return left

    def _move_links(self) -> None:
        for service in self._services:
            if service.client is not None and service.client.link.move():
                service.on_datagrams()

    def _tick(self) -> None:
        now = time.monotonic()
        self._cycle(*[arm.take_command(now) for arm in self._arms])
        for arm in self._arms:
            arm.send_state()
        self._cycles += 1
        if self._cycles % CYCLES_PER_STEP == 0:
            for hand in self._hands:
                hand.tick(now, STEP)
            for service in self._services:
                service.housekeeping(now)
