"""Speed scale of a robot, from 0 (standstill) to 1, by which a supervisor slows down the controllers.

Each `RobotHW` has a speed scale. A controller that obeys it gets its handle in `init`, by which it is known to obey,
and advances its motion by `ScaledTime`: the path remains the same, but takes more time. A controller that does not get
the handle is not slowed down; the supervisor must stop it.

The scale s approaches the requested one with |ds/dt| <= RATE and |d2s/dt2| <= ACCELERATION. So the deceleration of a
motion with velocity v increases by at most RATE v.
"""

import math
from typing import NamedTuple

from hric_control.hardware_interface import HardwareInterface
from hric_core.errors import CommandError

RATE = 3.4
"""Largest rate of change of the speed scale [1/s] (project default).

It is below the smallest ratio of acceleration to velocity limit of the Panda's joints, that of joint 2: 7.5 rad/s^2 to
2.175 rad/s, 3.45 1/s (Franka's published limits)."""
ACCELERATION = 68.0
"""Largest second derivative of the speed scale [1/s^2]: RATE is reached within 50 ms (project default).

At 2.175 rad/s this is a jerk of 148 rad/s^3; Franka's limit is 3750 rad/s^3."""
_SETTLED = 1e-9
RESOURCE = "speed_scale"


def stopping_time(scale: float) -> float:
    """Return the time in which the speed scale goes from a constant value to 0 [s].

    The rate of the scale ramps up to RATE, stays constant, and ramps down again."""
    if scale * ACCELERATION <= RATE * RATE:
        return 2.0 * math.sqrt(scale / ACCELERATION)
    return scale / RATE + RATE / ACCELERATION


class ScaleRequest(NamedTuple):
    """Limits that a supervisor or another node (the holder) requests from the robot.

    Attributes:
        scale: speed scale, 0 (standstill) to 1.
        stiffness: largest translational stiffness of compliant controllers [N/m].
        force: largest spring force of compliant controllers [N].
        valid_for: robot time after which the robot stops, unless the same holder sends another request [s]; at most
            LONGEST_LEASE.
    """

    scale: float = 1.0
    stiffness: float = math.inf
    force: float = math.inf
    valid_for: float = math.inf

    def check(self) -> "ScaleRequest":
        """Return the request if its values are valid, else raise CommandError."""
        if not 0.0 <= self.scale <= 1.0:
            raise CommandError(f"speed scale is {self.scale}; valid: 0 to 1")
        for name in ("stiffness", "force", "valid_for"):
            if not getattr(self, name) >= 0.0:
                raise CommandError(f"{name} is {getattr(self, name)}; valid: 0 or more")
        return self


UNLIMITED = ScaleRequest()
"""Request without any limit and without an end, by which a holder ends its lease."""
LONGEST_LEASE = 3600.0
"""Longest time for which a request is valid [s of robot time]; then a lost node does not slow down the robot forever.

Project default, unconfirmed."""
MAX_HOLDERS = 16
"""Largest number of nodes with a lease of their own (project default, unconfirmed).

All further nodes, and those without a name, share the lease `OTHERS`; in it, a request can only reduce the limits."""
OTHERS = "others"


def _smaller(before: ScaleRequest | None, request: ScaleRequest) -> ScaleRequest:
    """Return a request with the smaller value of each limit of two requests."""
    return request if before is None else ScaleRequest(*map(min, before, request))


class _Lease(NamedTuple):
    """Present request of a holder, and the robot time at which it expires [s]."""

    request: ScaleRequest
    expires: float


class SpeedScale:
    """Speed scale of one robot. `request` may be called from any thread, everything else only in the control loop.

    The request of a node (the holder) is a lease. The smallest scale, stiffness and force of all leases apply. If a
    lease expires, the robot stops until its holder sends another request. A request without any limit and without an
    end (`UNLIMITED`) ends the lease.

    Attributes:
        value: present speed scale; exactly 1 if no holder requests less.
        stiffness, force: present limits [N/m], [N]; a controller filters them as it does its gains.
        target: scale that `value` approaches.
        active: True if `advance` must be called.
        lost: names of the holders whose leases have expired; while there are any, the robot is stopped.
        holder: name of the holder whose scale applies, or of the lost ones; empty if nothing is limited.
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
        """True if the robot is stopped because a holder's lease has expired."""
        return bool(self.lost)

    def request(self, request: ScaleRequest, holder: str = "") -> None:
        """Replace the previous request of a holder. Raises CommandError if the request is not valid."""
        request.check()
        self._pending[holder] = _smaller(self._pending.get(holder), request) if holder == OTHERS else request
        self.active = True

    def advance(self, time: float, period: float) -> None:
        """Advance the scale by one control cycle, to robot time `time` [s], `period` [s] after the last cycle."""
        if self._pending or time > self._next_expiry or time < self._now:
            self._settle(time)
        self._now = time
        self._step(period)
        if self.value == self.target == 1.0 and not self._leases:
            # This order keeps a request that another thread makes in between from being lost.
            self.active = False
            self.active = bool(self._pending)

    def _settle(self, time: float) -> None:
        """Apply new requests, and update the lost holders and the limits for robot time `time` [s]."""
        leases = self._leases
        while self._pending:
            holder, request = self._pending.popitem()  # atomic: other threads may add requests meanwhile
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
        # Largest rate that can be reduced to zero, in steps, within the remaining change of the scale.
        rate = -0.5 * step + math.sqrt(0.25 * step * step + 2.0 * ACCELERATION * abs(error))
        aimed = math.copysign(min(RATE, rate), error)
        self._rate = min(max(aimed, self._rate - step), self._rate + step)
        self.value = min(max(self.value + self._rate * period, 0.0), 1.0)
        if abs(self.target - self.value) < max(_SETTLED, 0.5 * step * period) and abs(self._rate) <= step:
            self.value, self._rate = self.target, 0.0


class SpeedScaleInterface(HardwareInterface):
    """Hardware interface to the robot's speed scale, which any number of controllers may read.

    Attributes:
        scale: speed scale of the robot.
        declared: True if `handle` was called since `clear_claims`: then the controller obeys the speed scale.
    """

    cpp_name = "hric_control::SpeedScaleInterface"

    def __init__(self) -> None:
        super().__init__()
        self.scale, self.declared = SpeedScale(), False

    @property
    def names(self) -> tuple[str, ...]:
        """Name of the only resource, the speed scale."""
        return (RESOURCE,)

    def clear_claims(self) -> None:
        """Clear the claims and `declared`; the manager calls this before each controller's `init`."""
        super().clear_claims()
        self.declared = False

    def handle(self) -> SpeedScale:
        """Return the speed scale for reading. By this call, a controller declares that it obeys the scale."""
        self.declared = True
        return self.scale


class ScaledTime:
    """Time of a motion that obeys the speed scale: it passes more slowly than robot time, and stops at scale 0.

    Attributes:
        scale: speed scale of the robot.
        lag: delay of this time behind robot time [s]; 0 as long as the scale has always been 1.
    """

    __slots__ = ("_last", "lag", "scale")

    def __init__(self, scale: SpeedScale) -> None:
        self.scale, self.lag, self._last = scale, 0.0, 0.0

    def restart(self, time: float) -> None:
        """Begin a new motion at robot time `time` [s]; the time of the motion then equals robot time again."""
        self.lag, self._last = 0.0, time

    def along(self, time: float, period: float) -> float:
        """Return the time of the motion [s]; to be called once per cycle.

        `time` is robot time [s], `period` the time since the last cycle [s]."""
        scale = self.scale.value
        if scale != 1.0:
            self.lag += (1.0 - scale) * period
            if scale == 0.0:  # exactly constant, without rounding errors
                return self._last
        self._last = max(time - self.lag, self._last)
        return self._last
