"""Penalty contact, integrated within a step of the engine: two bodies along their normal, as one mass on a spring.

An engine applies a constant force during its step, and an impact on a stiff surface lasts only a few steps. If the
spring were evaluated at one instant of the step, peak and impulse would depend on when in the step the contact begins.
So the motion along the normal is integrated through the step,

    x'' = a - w F(x, x', ...)    while x > 0,

with penetration x, contact force F (`plants.contact_law`), the pair's inverse effective mass
w = n' J (M + B)^-1 J' n, and the acceleration a that the pair would have without the spring. The mean of the force,
which has the same impulse, is applied. The reported force is that at the end of the step or, if it is larger, the
maximum within the step: the reading of a sensor with peak hold that is sampled once per step.

In the tangential plane a bristle holds the two bodies, by the elasto-plastic law also used for joints
(`plants.friction`): a spring that yields when its force reaches friction coefficient times normal force, so that a body
at rest does not creep. Its force f is also constant during the step. With the tangential velocity u at the end of the
step that would result from the force of the last step, and the step h,

    f = f_before - h k / (1 + C h^2 k w) u,    |f| <= friction * normal force,

where k is the bristle's stiffness and w the tangential inverse effective mass. For C = 1 this is the implicit Euler
method for a single contact.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hric_control.plant import FloatArray
from hric_control.plants.contact_law import ContactLaw, Strains

_PARTS = 8
"""Smallest number of Runge-Kutta substeps of a step, used for soft contacts (project default, unconfirmed)."""
_PARTS_PER_RADIAN = 4
"""Additional substeps per radian of the contact's oscillation, for stiff contacts."""
_MAX_PARTS = 64
BRISTLE_STIFFNESS = 1e6
"""Stiffness of the friction bristle of a contact [N/m] (project default, unconfirmed): 10 N deflect it by 0.01 mm.

There is no source for it; it is much stiffer than the contact spring along the normal."""
_SHARED = 4.0
"""Factor C in the bristle force f = f_before - h k / (1 + C h^2 k w) u (project default, unconfirmed).

With this value, up to five contacts of one body, which are computed independently of each other, are stable with a
bristle of any stiffness."""


@dataclass(frozen=True, slots=True)
class SpringStep:
    """Result of integrating a contact spring through one step.

    Attributes:
        mean: mean force, the impulse divided by the step [N].
        reading: force at the end of the step, or its maximum within the step if that is larger [N].
        ahead: depth at the end of the step, minus the depth that the engine reaches with the constant mean force [m].
        works: work that the bodies have done on the contact until the end of each substep, ascending in time [J].
        strains: deflections of the contact's layers at the end of the step [m].
    """

    mean: float
    reading: float
    ahead: float
    works: tuple[float, ...] = ()
    strains: Strains = ()


NOTHING = SpringStep(0.0, 0.0, 0.0)


def _touch_time(depth: float, speed: float, acceleration: float, step: float) -> float:
    """Return the time until a gap (negative depth) closes [s]; `step` if it does not close within the step."""
    if depth + speed * step + 0.5 * acceleration * step * step <= 0.0 and (speed <= 0.0 or acceleration >= 0.0):
        return step
    root = speed * speed - 2.0 * acceleration * depth
    if root <= 0.0:
        return step
    # This form of the root has no cancellation of digits.
    pace = speed + math.sqrt(root)
    return min(-2.0 * depth / pace, step) if pace > 0.0 else step


def spring_step(
    depth: float,
    speed: float,
    acceleration: float,
    inverse_mass: float,
    law: ContactLaw,
    step: float,
    strains: Strains = (),
) -> SpringStep:
    """Integrate the motion of two bodies along their contact normal, with the contact's force, through one step.

    Args:
        depth: penetration at the start, negative for a gap [m].
        speed: closing speed at the start [m/s].
        acceleration: closing acceleration without the spring [m/s^2].
        inverse_mass: inverse effective mass of the pair along the normal [1/kg].
        law: law of the contact's force.
        step: time step of the engine [s].
        strains: deflections of the contact's layers at the start [m]; empty: zero.
    """
    left = step
    x, v, z = depth, speed, strains or (0.0,) * len(law.layers)
    if depth <= 0.0:
        free = _touch_time(depth, speed, acceleration, step)
        left = step - free
        if left <= 0.0:
            return NOTHING
        x, v = 0.0, speed + acceleration * free
    parts = _substeps(law, max(x, x + v * left), inverse_mass, left)
    h = left / parts
    impulse, work, works = 0.0, 0.0, list[float]()
    first = load = peak = law.load(x, v, z)
    for _ in range(parts):
        x, v, z, part, done, middle = _substep(law, (x, v, z), load, acceleration, inverse_mass, h)
        impulse += part
        work += done
        load = law.load(x, v, z)
        peak = max(peak, middle, load)
        works.append(work)
    mean = impulse / step
    held = depth + step * (speed + 0.5 * step * (acceleration - inverse_mass * mean))
    return SpringStep(mean, load if first >= peak else peak, x - held, tuple(works), z)


def _substep(
    law: ContactLaw,
    state: tuple[float, float, Strains],
    load: float,
    acceleration: float,
    inverse_mass: float,
    h: float,
) -> tuple[float, float, Strains, float, float, float]:
    """Advance by a substep with the classical Runge-Kutta method of fourth order.

    Args:
        law: law of the contact's force.
        state: penetration [m], closing speed [m/s], and deflections of the layers [m].
        load: force in this state [N].
        acceleration: closing acceleration without the spring [m/s^2].
        inverse_mass: inverse effective mass of the pair along the normal [1/kg].
        h: duration of the substep [s].

    Returns:
        the new state, impulse [N s] and work [J] of the force, and the force at the middle [N].
    """
    x, v, z = state
    half = 0.5 * h
    r1 = z and law.rates(z, load)
    v2 = v + half * (acceleration - inverse_mass * load)
    z2 = z and _moved(z, half, r1)
    f2 = law.load(x + half * v, v2, z2)
    r2 = z and law.rates(z2, f2)
    v3 = v + half * (acceleration - inverse_mass * f2)
    z3 = z and _moved(z, half, r2)
    f3 = law.load(x + half * v2, v3, z3)
    r3 = z and law.rates(z3, f3)
    v4 = v + h * (acceleration - inverse_mass * f3)
    z4 = z and _moved(z, h, r3)
    f4 = law.load(x + h * v3, v4, z4)
    # The impulse is the weighted sum of the stages' forces.
    part = h / 6.0 * (load + 2.0 * (f2 + f3) + f4)
    work = h / 6.0 * (load * v + 2.0 * (f2 * v2 + f3 * v3) + f4 * v4)
    if z:
        rates = zip(r1, r2, r3, law.rates(z4, f4), strict=True)
        z = _moved(z, h / 6.0, tuple(a + 2.0 * (b + c) + d for a, b, c, d in rates))
    x += h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
    v += h * acceleration - inverse_mass * part
    return x, v, z, part, work, f2


def _moved(strains: Strains, step: float, rates: Strains) -> Strains:
    return tuple(z + step * rate for z, rate in zip(strains, rates, strict=True))


def _substeps(law: ContactLaw, depth: float, inverse_mass: float, duration: float) -> int:
    """Return the number of substeps for a duration [s], in which the penetration reaches about `depth` [m]."""
    radians = math.sqrt(law.tangent(depth) * inverse_mass) * duration
    radians = max([radians, *(duration / layer.relaxation_time for layer in law.layers)])
    return min(_PARTS + int(_PARTS_PER_RADIAN * radians), _MAX_PARTS)


@dataclass(slots=True)
class _Memory:
    """State of the contact of a pair of links that is kept for the next step.

    Attributes:
        push: reduction of the closing acceleration by the spring's mean force [m/s^2].
        ahead: error of the engine's depth, see SpringStep [m].
        rub: friction force on the first link, shape (3,) [N]; None: the contact has just begun.
        strains: deflections of the contact's layers [m].
        work: work that the bodies have done on the contact since it began [J].
        energy: largest work so far [J].
    """

    push: float = 0.0
    ahead: float = 0.0
    rub: FloatArray | None = None
    strains: Strains = ()
    work: float = 0.0
    energy: float = 0.0


@dataclass
class Springs:
    """Contact springs between pairs of links, one for each pair in contact, with the peak forces since `take_peaks`.

    The acceleration without the spring is estimated from the last step: the measured acceleration plus the reduction by
    the spring's force. So a body at rest on its spring stays at rest, whatever force presses it.

    Args:
        time_step: time step of the plant [s].
    """

    time_step: float
    _now: dict[tuple[str, str], _Memory] = field(default_factory=dict)
    _before: dict[tuple[str, str], _Memory] = field(default_factory=dict)
    _peaks: dict[tuple[str, str], float] = field(default_factory=dict)

    def forget(self) -> None:
        """Discard the states of all contacts; called after bodies were moved."""
        self._now, self._before, self._peaks = {}, {}, {}

    def begin(self) -> None:
        """Begin a new step; the state of a pair is discarded unless `push` is called for it in this step."""
        self._before, self._now = self._now, {}

    def push(
        self,
        pair: tuple[str, str],
        depth: float,
        speed: float,
        measured: float,
        inverse_mass: float,
        law: ContactLaw,
    ) -> SpringStep:
        """Compute the normal force between a pair of links in this step.

        Args:
            pair: names of the links.
            depth: penetration at the start of the step [m].
            speed: closing speed at the start of the step [m/s].
            measured: closing acceleration over the last step [m/s^2].
            inverse_mass: inverse effective mass of the pair along its normal [1/kg].
            law: law of the contact's force.
        """
        before = self._before.get(pair) or _Memory()
        done = spring_step(
            depth + before.ahead, speed, measured + before.push, inverse_mass, law, self.time_step, before.strains
        )
        memory = self._now[pair] = _Memory(inverse_mass * done.mean, strains=done.strains)
        if done.mean > 0.0:
            # In a smooth motion `ahead` is inverse_mass * mean * time_step^2 / 12; the bound keeps errors from adding
            # up if the mass is not known well.
            bound = inverse_mass * done.mean * self.time_step**2 / 4.0
            memory.ahead = min(max(before.ahead + done.ahead, -bound), bound)
            memory.work = before.work + done.works[-1]
            memory.energy = max(before.energy, before.work + max(done.works))
            self._peaks[pair] = max(self._peaks.get(pair, 0.0), done.reading)
        return done

    def energy(self, pair: tuple[str, str]) -> float:
        """Return the largest work that a pair of links has done on its contact since the contact began [J]."""
        return self._now[pair].energy

    def rub(
        self,
        pair: tuple[str, str],
        bound: float,
        normal: FloatArray,
        relative: FloatArray,
        inverse_mass: Callable[[FloatArray], float],
    ) -> FloatArray:
        """Return the friction force on link a in this step, shape (3,) [N]; to be called after `push`.

        Args:
            pair: names of the links a and b.
            bound: largest friction force: friction coefficient times normal force [N].
            normal: unit vector from b to a, shape (3,).
            relative: velocity of a relative to b at the contact point now, and of the same material points one step
                before, shape (2, 3) [m/s].
            inverse_mass: function that returns the pair's inverse effective mass along a unit vector [1/kg].
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
        """Return the largest contact force of each pair of links since the last call [N]."""
        peaks, self._peaks = self._peaks, {}
        return peaks
