"""Penalty contact within one step: the two bodies along their normal, as one mass on the spring.

An engine holds a force over its step, and an impact on a stiff surface lasts a few steps only: a spring that is
evaluated at one instant of the step gives a peak and an impulse that depend on where in the step the contact began.
Here the motion along the normal is integrated through the step,

    x'' = a - w max(k x + c x', 0)    while x > 0,

with the pair's inverse effective mass w = n' J (M + B)^-1 J' n and the acceleration a that the pair would have without
the spring. The mean of the load is applied, which has the same impulse. The load at the end of the step is reported or,
if it had its maximum within the step, this maximum: the reading of a sensor that samples once a step and holds a peak.

Across the normal a bristle holds the two bodies, by the elasto-plastic law of the joints (`plants.friction`): a spring
that yields when its force reaches friction times load, so that a body at rest on it does not creep. Its force f is also
held over the step; with the speed u that the bodies would end the step with under the force of the last step,

    f = f_before - h k / (1 + C h^2 k w) u,    |f| <= friction * load,

which for C = 1 is the implicit Euler method on one contact with the inverse effective mass w across.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hric_control.plant import FloatArray

_PARTS = 8
"""Runge-Kutta substeps of a step for a spring that is slow compared with the step (project default, unconfirmed)."""
_PARTS_PER_RADIAN = 4
"""Additional substeps per radian of a fast spring's oscillation."""
_MAX_PARTS = 64
BRISTLE_STIFFNESS = 1e6
"""Stiffness of a bristle [N/m] (project default, unconfirmed): 10 N deflect it by 0.01 mm.

No source; far stiffer than the spring along the normal."""
_SHARED = 4.0
"""C in the module's docstring (project default, unconfirmed).

With it up to five contacts of one body, which are computed independently, stay stable with a bristle of any stiffness.
"""


@dataclass(frozen=True, slots=True)
class SpringStep:
    """Result of a spring in one step.

    Attributes:
        mean: impulse divided by the step [N].
        reading: load at the end of the step, or its maximum if that lies within [N].
        ahead: depth at the end of the step, minus the depth that the engine reaches with the mean held over the step
            [m].
    """

    mean: float
    reading: float
    ahead: float


NOTHING = SpringStep(0.0, 0.0, 0.0)


def _touch_time(depth: float, speed: float, acceleration: float, step: float) -> float:
    """Return the time at which a gap closes [s]; `step` if it does not close within the step."""
    if depth + speed * step + 0.5 * acceleration * step * step <= 0.0 and (speed <= 0.0 or acceleration >= 0.0):
        return step
    root = speed * speed - 2.0 * acceleration * depth
    if root <= 0.0:
        return step
    # The root without cancellation.
    pace = speed + math.sqrt(root)
    return min(-2.0 * depth / pace, step) if pace > 0.0 else step


def spring_step(
    depth: float, speed: float, acceleration: float, inverse_mass: float, stiffness: float, damping: float, step: float
) -> SpringStep:
    """Integrate one step.

    Args:
        depth: penetration at the start, negative for a gap [m].
        speed: rate at which the depth grows [m/s].
        acceleration: acceleration of the depth without the spring [m/s^2].
        inverse_mass: inverse effective mass of the pair along the normal [1/kg].
        stiffness: [N/m].
        damping: [N s/m].
        step: [s].
    """
    left = step
    x, v = depth, speed
    if depth <= 0.0:
        free = _touch_time(depth, speed, acceleration, step)
        left = step - free
        if left <= 0.0:
            return NOTHING
        x, v = 0.0, speed + acceleration * free
    parts = min(_PARTS + int(_PARTS_PER_RADIAN * math.sqrt(stiffness * inverse_mass) * left), _MAX_PARTS)
    h = left / parts
    half, impulse = 0.5 * h, 0.0
    first = load = peak = _load(x, v, stiffness, damping)
    for _ in range(parts):
        # Classical method of fourth order; the load of each stage enters the impulse.
        a1 = acceleration - inverse_mass * load
        v2 = v + half * a1
        f2 = _load(x + half * v, v2, stiffness, damping)
        v3 = v + half * (acceleration - inverse_mass * f2)
        f3 = _load(x + half * v2, v3, stiffness, damping)
        v4 = v + h * (acceleration - inverse_mass * f3)
        f4 = _load(x + h * v3, v4, stiffness, damping)
        part = h / 6.0 * (load + 2.0 * (f2 + f3) + f4)
        x += h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        v += h * acceleration - inverse_mass * part
        impulse += part
        load = _load(x, v, stiffness, damping)
        peak = max(peak, f2, load)
    mean = impulse / step
    held = depth + step * (speed + 0.5 * step * (acceleration - inverse_mass * mean))
    return SpringStep(mean, load if first >= peak else peak, x - held)


def _load(x: float, v: float, stiffness: float, damping: float) -> float:
    """Return the load of spring and damper [N]; a contact never pulls."""
    if x <= 0.0:
        return 0.0
    load = stiffness * x + damping * v
    return load if load > 0.0 else 0.0


@dataclass(slots=True)
class _Memory:
    """State of a pair of links that passes from one step to the next.

    Attributes:
        push: closing acceleration that the spring's mean took away [m/s^2].
        ahead: see SpringStep.
        rub: force of the bristle on a, shape (3,) [N]; None: the contact has just begun.
    """

    push: float = 0.0
    ahead: float = 0.0
    rub: FloatArray | None = None


@dataclass
class Springs:
    """Springs between all pairs of links, one each, with the state of one step and the peaks since `take_peaks`.

    The acceleration without the spring is the one measured over the last step plus what the spring took away in it, so
    that a body at rest on its spring stays there, whatever presses it.

    Args:
        time_step: [s].
    """

    time_step: float
    _now: dict[tuple[str, str], _Memory] = field(default_factory=dict)
    _before: dict[tuple[str, str], _Memory] = field(default_factory=dict)
    _peaks: dict[tuple[str, str], float] = field(default_factory=dict)

    def forget(self) -> None:
        """Forget all contacts after bodies were moved."""
        self._now, self._before, self._peaks = {}, {}, {}

    def begin(self) -> None:
        """Begin a new step; pairs without `push` in it are forgotten."""
        self._before, self._now = self._now, {}

    def push(
        self,
        pair: tuple[str, str],
        depth: float,
        speed: float,
        measured: float,
        inverse_mass: float,
        law: tuple[float, float],
    ) -> SpringStep:
        """Compute the spring of one pair in this step.

        Args:
            pair: names of its links.
            depth: penetration at the start of the step [m].
            speed: closing speed at the start of the step [m/s].
            measured: closing acceleration over the last step [m/s^2].
            inverse_mass: inverse effective mass of the pair along its normal [1/kg].
            law: stiffness [N/m] and damping [N s/m].
        """
        before = self._before.get(pair) or _Memory()
        done = spring_step(depth + before.ahead, speed, measured + before.push, inverse_mass, *law, self.time_step)
        memory = self._now[pair] = _Memory(inverse_mass * done.mean)
        if done.mean > 0.0:
            # In a smooth motion it is a twelfth of this; if the mass is not well known, errors must not add up.
            bound = inverse_mass * done.mean * self.time_step**2 / 4.0
            memory.ahead = min(max(before.ahead + done.ahead, -bound), bound)
            self._peaks[pair] = max(self._peaks.get(pair, 0.0), done.reading)
        return done

    def rub(
        self,
        pair: tuple[str, str],
        bound: float,
        normal: FloatArray,
        relative: FloatArray,
        inverse_mass: Callable[[FloatArray], float],
    ) -> FloatArray:
        """Return the friction force on a in this step, shape (3,) [N]; called after `push`.

        Args:
            pair: names of its links.
            bound: friction times load [N].
            normal: from b to a, unit vector, shape (3,).
            relative: velocity of a relative to b at the contact now, and of the same material a step before, shape
                (2, 3) [m/s].
            inverse_mass: function from a unit vector to the pair's inverse effective mass along it [1/kg].
        """
        before = self._before.get(pair) or _Memory()
        end = 2.0 * relative[0] - relative[1]
        end = end - (end @ normal) * normal
        force = np.zeros(3) if before.rub is None else before.rub - (before.rub @ normal) * normal
        speed = math.sqrt(float(end @ end))
        if speed > 0.0:
            stiffness = self.time_step * BRISTLE_STIFFNESS
            give = 1.0 + _SHARED * self.time_step * stiffness * inverse_mass(end / speed)
            force = force - stiffness / give * end
        size = math.sqrt(float(force @ force))
        if size > bound:
            force = bound / size * force
        self._now[pair].rub = force
        return force

    def take_peaks(self) -> dict[tuple[str, str], float]:
        """Return the largest reading per pair since the last call [N]."""
        peaks, self._peaks = self._peaks, {}
        return peaks
