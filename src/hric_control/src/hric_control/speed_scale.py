"""How a supervisor slows controllers down: one speed scale of the robot, which they read.

Each `RobotHW` has the resource. A controller that obeys takes its handle in `init`, which declares it, and leads its
motion on by `ScaledTime`, so that the path stays and only the time along it stretches. Who does not take the handle is
not slowed; the supervisor stops it.

The scale s goes to what was requested with |ds/dt| <= RATE and |d2s/dt2| <= ACCELERATION. A motion of velocity v then
brakes by at most RATE v beside what it does anyway.
"""

import math
from typing import NamedTuple

from hric_control.hardware_interface import HardwareInterface
from hric_core.errors import CommandError

RATE = 3.4
"""Largest rate of the scale [1/s]: of the Panda's joints the second has the least acceleration for its speed, 7.5
rad/s^2 at 2.175 rad/s, 3.45 1/s (Franka's published limits); chosen here."""
ACCELERATION = 68.0
"""Largest change of that rate [1/s^2]: RATE within 50 ms; at 2.175 rad/s a jerk of 148 rad/s^3, of 3750 allowed; chosen
here."""
_SETTLED = 1e-9
RESOURCE = "speed_scale"


def stopping_time(scale: float) -> float:
    """How long it takes from a scale at rest to 0 [s]: a ramp of the rate up, the rate held, and the ramp down."""
    if scale * ACCELERATION <= RATE * RATE:
        return 2.0 * math.sqrt(scale / ACCELERATION)
    return scale / RATE + RATE / ACCELERATION


class Request(NamedTuple):
    """What a supervisor requests of the robot.

    Attributes:
        scale: of the speed, 0 (standstill) to 1.
        stiffness: largest translational stiffness of controllers that have one [N/m].
        force: largest force of their springs [N].
        valid_for: without another request of the same holder the robot stops after so long of robot time [s], and after
            LONGEST_LEASE at the latest.
    """

    scale: float = 1.0
    stiffness: float = math.inf
    force: float = math.inf
    valid_for: float = math.inf

    def check(self) -> "Request":
        """Itself. Raises CommandError."""
        if not 0.0 <= self.scale <= 1.0:
            raise CommandError(f"speed scale is {self.scale}; valid: 0 to 1")
        for name in ("stiffness", "force", "valid_for"):
            if not getattr(self, name) >= 0.0:
                raise CommandError(f"{name} is {getattr(self, name)}; valid: 0 or more")
        return self


UNLIMITED = Request()
"""Request that limits nothing and never ends: it gives a lease back."""
LONGEST_LEASE = 3600.0
"""Longest time without another request of a holder [s]: one that is gone holds no limit that nobody watches (project
default, unconfirmed)."""
MAX_HOLDERS = 16
"""Holders with a lease each (project default, unconfirmed). All others, and those without a name, share the lease
`OTHERS`, in which each only makes the robot slower."""
OTHERS = "others"


def _smaller(before: Request | None, request: Request) -> Request:
    """Return the smaller of each limit."""
    return request if before is None else Request(*map(min, before, request))


class _Lease(NamedTuple):
    """Request of a holder, and when it expires [s of robot time]."""

    request: Request
    expires: float


class SpeedScale:
    """The scale of one robot. `request` may come from any thread, the rest is the loop's.

    Who requests holds a lease. Of all leases the smallest scale, stiffness and force count. One that expires stops the
    robot until its holder requests again; a request without any limit and without an end gives the lease back.

    Attributes:
        value: in force; exactly 1 where no less was requested.
        stiffness, force: limits in force [N/m], [N]; a controller filters them as it does its gains.
        target: scale that the value goes to.
        active: True if `advance` has something to do.
        lost: holders whose leases have expired; while there are any the robot comes to a stop.
        holder: name of the holder whose scale counts, or of those that are lost; empty where nothing is limited.
    """

    def __init__(self) -> None:
        self.value, self._rate, self.target = 1.0, 0.0, 1.0
        self.stiffness = self.force = self._next_expiry = math.inf
        self._now = -math.inf
        self._pending: dict[str, Request] = {}
        self._leases: dict[str, _Lease] = {}
        self.active, self.holder = False, ""
        self.lost: tuple[str, ...] = ()

    @property
    def expired(self) -> bool:
        """True if the robot stops because a holder fell silent."""
        return bool(self.lost)

    def request(self, request: Request, holder: str = "") -> None:
        """Replace what this holder requested before. Raises CommandError."""
        request.check()
        self._pending[holder] = _smaller(self._pending.get(holder), request) if holder == OTHERS else request
        self.active = True

    def advance(self, time: float, period: float) -> None:
        """One cycle of the loop, at robot time `time` [s], `period` [s] after the last."""
        if self._pending or time > self._next_expiry or time < self._now:
            self._settle(time)
        self._now = time
        self._step(period)
        if self.value == self.target == 1.0 and not self._leases:
            # In this order, so that a request from another thread in between is not lost.
            self.active = False
            self.active = bool(self._pending)

    def _settle(self, time: float) -> None:
        """Take the new requests up, and find who is lost and what counts at robot time `time` [s]."""
        leases = self._leases
        while self._pending:
            holder, request = self._pending.popitem()  # at once, whoever requests meanwhile
            if holder not in leases and len(leases) >= MAX_HOLDERS:
                holder = OTHERS
            if holder == OTHERS:
                request = _smaller(leases[OTHERS].request if OTHERS in leases else None, request)
            if request == UNLIMITED:
                leases.pop(holder, None)
                continue
            leases[holder] = _Lease(request, time + min(request.valid_for, LONGEST_LEASE))
        if time < self._now:  # the clock was set back: nobody's lease became longer
            for holder, (request, expires) in leases.items():
                leases[holder] = _Lease(request, min(expires, time + min(request.valid_for, LONGEST_LEASE)))
        smallest, holder_of_it, lost = UNLIMITED, "", []
        self.stiffness = self.force = self._next_expiry = math.inf
        for holder, (request, expires) in leases.items():
            if request < smallest:
                smallest, holder_of_it = request, holder
            if request.stiffness < self.stiffness:
                self.stiffness = request.stiffness
            if request.force < self.force:
                self.force = request.force
            if time > expires:
                lost.append(holder)
            elif expires < self._next_expiry:
                self._next_expiry = expires
        self.lost, self.target = tuple(lost), 0.0 if lost else smallest.scale
        self.holder = ", ".join(lost) or ("" if smallest[:3] == UNLIMITED[:3] else holder_of_it)

    def _step(self, period: float) -> None:
        error = self.target - self.value
        if error == 0.0 == self._rate:
            return
        step = ACCELERATION * period
        # The largest rate from which steps of the deceleration come to rest within what is left.
        rate = -0.5 * step + math.sqrt(0.25 * step * step + 2.0 * ACCELERATION * abs(error))
        aimed = math.copysign(min(RATE, rate), error)
        self._rate = min(max(aimed, self._rate - step), self._rate + step)
        self.value = min(max(self.value + self._rate * period, 0.0), 1.0)
        if abs(self.target - self.value) < max(_SETTLED, 0.5 * step * period) and abs(self._rate) <= step:
            self.value, self._rate = self.target, 0.0


class SpeedScaleInterface(HardwareInterface):
    """The scale as a resource that any number of controllers read.

    Attributes:
        scale: of the robot.
        declared: whether a handle was taken since `clear_claims`.
    """

    cpp_name = "hric_control::SpeedScaleInterface"

    def __init__(self) -> None:
        super().__init__()
        self.scale, self.declared = SpeedScale(), False

    @property
    def names(self) -> tuple[str, ...]:
        """Of the one resource."""
        return (RESOURCE,)

    def clear_claims(self) -> None:
        """See the base."""
        super().clear_claims()
        self.declared = False

    def handle(self) -> SpeedScale:
        """To read; whoever takes it declares that it obeys."""
        self.declared = True
        return self.scale


class ScaledTime:
    """Robot time as it passes for a motion that obeys the scale: it stops where the scale is 0.

    Attributes:
        scale: as given.
        lag: how far it is behind [s]; 0 as long as the scale was 1.
    """

    __slots__ = ("_last", "lag", "scale")

    def __init__(self, scale: SpeedScale) -> None:
        self.scale, self.lag, self._last = scale, 0.0, 0.0

    def restart(self, time: float) -> None:
        """A motion begins at robot time `time` [s]."""
        self.lag, self._last = 0.0, time

    def along(self, time: float, period: float) -> float:
        """Time of the motion [s]; once per cycle, at robot time `time`, `period` after the last [s]."""
        scale = self.scale.value
        if scale != 1.0:
            self.lag += (1.0 - scale) * period
            if scale == 0.0:  # to the bit, whatever rounding makes of the difference
                return self._last
        self._last = max(time - self.lag, self._last)
        return self._last
