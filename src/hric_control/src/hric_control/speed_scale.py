"""Speed scale of the robot, by which a supervisor slows controllers down.

Each `RobotHW` has the resource. A controller that obeys takes its handle in `init`, which declares it, and advances its
motion by `ScaledTime`: the path stays and only the time along it stretches. A controller that does not take the handle
is not slowed; the supervisor stops it.

The scale s approaches the requested one with |ds/dt| <= RATE and |d2s/dt2| <= ACCELERATION. A motion of velocity v then
decelerates by at most RATE v in addition to its own acceleration.
"""

import math
from typing import NamedTuple

from hric_control.hardware_interface import HardwareInterface
from hric_core.errors import CommandError

RATE = 3.4
"""Largest rate of the scale [1/s] (project default).

Of the Panda's joints the second has the least acceleration for its speed: 7.5 rad/s^2 at 2.175 rad/s, 3.45 1/s
(Franka's published limits)."""
ACCELERATION = 68.0
"""Largest change of that rate [1/s^2]: RATE within 50 ms (project default).

At 2.175 rad/s this is a jerk of 148 rad/s^3, of 3750 allowed."""
_SETTLED = 1e-9
RESOURCE = "speed_scale"


def stopping_time(scale: float) -> float:
    """Return the time from a scale at rest to 0 [s]: a ramp of the rate up, the rate held, and the ramp down."""
    if scale * ACCELERATION <= RATE * RATE:
        return 2.0 * math.sqrt(scale / ACCELERATION)
    return scale / RATE + RATE / ACCELERATION


class ScaleRequest(NamedTuple):
    """Limits that a supervisor requests of the robot.

    Attributes:
        scale: speed scale, 0 (standstill) to 1.
        stiffness: largest translational stiffness of controllers that have one [N/m].
        force: largest force of their springs [N].
        valid_for: robot time until the robot stops without another request of the same holder [s], at most
            LONGEST_LEASE.
    """

    scale: float = 1.0
    stiffness: float = math.inf
    force: float = math.inf
    valid_for: float = math.inf

    def check(self) -> "ScaleRequest":
        """Return the request if it is valid. Raises CommandError."""
        if not 0.0 <= self.scale <= 1.0:
            raise CommandError(f"speed scale is {self.scale}; valid: 0 to 1")
        for name in ("stiffness", "force", "valid_for"):
            if not getattr(self, name) >= 0.0:
                raise CommandError(f"{name} is {getattr(self, name)}; valid: 0 or more")
        return self


UNLIMITED = ScaleRequest()
"""Request that limits nothing and never expires: it gives a lease back."""
LONGEST_LEASE = 3600.0
"""Longest time without another request of a holder [s], so that no limit outlives a lost holder for long.

Project default, unconfirmed."""
MAX_HOLDERS = 16
"""Number of holders with a lease each (project default, unconfirmed).

All others, and those without a name, share the lease `OTHERS`, in which a request can only make the robot slower."""
OTHERS = "others"


def _smaller(before: ScaleRequest | None, request: ScaleRequest) -> ScaleRequest:
    """Return the smaller of each limit."""
    return request if before is None else ScaleRequest(*map(min, before, request))


class _Lease(NamedTuple):
    """Request of a holder and the time at which it expires [s of robot time]."""

    request: ScaleRequest
    expires: float


class SpeedScale:
    """Speed scale of one robot. `request` may be called from any thread, the rest only in the loop.

    A holder's request is a lease. The smallest scale, stiffness and force of all leases apply. A lease that expires
    stops the robot until its holder requests again; a request without any limit and without an end gives the lease
    back.

    Attributes:
        value: scale in force; exactly 1 if no holder requests less.
        stiffness, force: limits in force [N/m], [N]; a controller filters them as it does its gains.
        target: scale that the value approaches.
        active: True if `advance` has something to do.
        lost: holders whose leases have expired; while there are any the robot comes to a stop.
        holder: name of the holder whose scale applies, or of those that are lost; empty if nothing is limited.
    """

    def __init__(self) -> None:
        self.value, self._rate, self.target = 1.0, 0.0, 1.0
        self.stiffness = self.force = self._next_expiry = math.inf
        self._now = -math.inf
        self._pending: dict[str, ScaleRequest] = {}
        self._leases: dict[str, _Lease] = {}
        self.active, self.holder = False, ""
        self.lost: tuple[str, ...] = ()

    @property
    def expired(self) -> bool:
        """True if the robot stops because a holder's lease has expired."""
        return bool(self.lost)

    def request(self, request: ScaleRequest, holder: str = "") -> None:
        """Replace the previous request of this holder. Raises CommandError."""
        request.check()
        self._pending[holder] = _smaller(self._pending.get(holder), request) if holder == OTHERS else request
        self.active = True

    def advance(self, time: float, period: float) -> None:
        """Advance by one cycle of the loop, to robot time `time` [s], `period` [s] after the last cycle."""
        if self._pending or time > self._next_expiry or time < self._now:
            self._settle(time)
        self._now = time
        self._step(period)
        if self.value == self.target == 1.0 and not self._leases:
            # In this order, so that a request from another thread in between is not lost.
            self.active = False
            self.active = bool(self._pending)

    def _settle(self, time: float) -> None:
        """Apply new requests; update lost holders and the limits in force at robot time `time` [s]."""
        leases = self._leases
        while self._pending:
            holder, request = self._pending.popitem()  # atomic, as other threads may request meanwhile
            if holder not in leases and len(leases) >= MAX_HOLDERS:
                holder = OTHERS
            if holder == OTHERS:
                request = _smaller(leases[OTHERS].request if OTHERS in leases else None, request)
            if request == UNLIMITED:
                leases.pop(holder, None)
                continue
            leases[holder] = _Lease(request, time + min(request.valid_for, LONGEST_LEASE))
        if time < self._now:  # the clock was set back: no lease may become longer
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
        # The largest rate from which steps of the deceleration come to rest within the remaining change.
        rate = -0.5 * step + math.sqrt(0.25 * step * step + 2.0 * ACCELERATION * abs(error))
        aimed = math.copysign(min(RATE, rate), error)
        self._rate = min(max(aimed, self._rate - step), self._rate + step)
        self.value = min(max(self.value + self._rate * period, 0.0), 1.0)
        if abs(self.target - self.value) < max(_SETTLED, 0.5 * step * period) and abs(self._rate) <= step:
            self.value, self._rate = self.target, 0.0


class SpeedScaleInterface(HardwareInterface):
    """Interface to the speed scale, which any number of controllers read.

    Attributes:
        scale: speed scale of the robot.
        declared: True if a handle was taken since `clear_claims`.
    """

    cpp_name = "hric_control::SpeedScaleInterface"

    def __init__(self) -> None:
        super().__init__()
        self.scale, self.declared = SpeedScale(), False

    @property
    def names(self) -> tuple[str, ...]:
        """Name of the single resource."""
        return (RESOURCE,)

    def clear_claims(self) -> None:
        """Forget the claims and the declaration."""
        super().clear_claims()
        self.declared = False

    def handle(self) -> SpeedScale:
        """Return the scale to read. A controller that takes it declares that it obeys."""
        self.declared = True
        return self.scale


class ScaledTime:
    """Robot time as it passes for a motion that obeys the scale; it stops while the scale is 0.

    Attributes:
        scale: speed scale of the robot.
        lag: delay behind robot time [s]; 0 as long as the scale was 1.
    """

    __slots__ = ("_last", "lag", "scale")

    def __init__(self, scale: SpeedScale) -> None:
        self.scale, self.lag, self._last = scale, 0.0, 0.0

    def restart(self, time: float) -> None:
        """Begin a motion at robot time `time` [s]."""
        self.lag, self._last = 0.0, time

    def along(self, time: float, period: float) -> float:
        """Return the time of the motion [s]; once per cycle, at robot time `time`, `period` after the last [s]."""
        scale = self.scale.value
        if scale != 1.0:
            self.lag += (1.0 - scale) * period
            if scale == 0.0:  # exactly constant, without rounding errors
                return self._last
        self._last = max(time - self.lag, self._last)
        return self._last
