"""Muscles of a body: moment arms and forces at given joint angles, scaled to the person's size and strength.

Lengths of a muscle scale with the segments that it spans, its strength with the person's mass and sex (the rule of
`hric_human.control.strength`; for single muscles unconfirmed). An arm joint without muscles, such as the wrist, has two
ideal torque actuators with activation, one for each direction.
"""

from collections.abc import Iterable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.native import load
from hric_human.body import Body
from hric_human.body.joints import ARM
from hric_human.control.strength import STRENGTH, mass_factor, strength
from hric_human.muscles import curves
from hric_human.muscles.anatomy import Anatomy, Muscle
from hric_human.muscles.polynomial import Polynomial

SPANNED = {
    "sh_flex": ("upper_arm",),
    "sh_abd": ("upper_arm",),
    "sh_rot": ("upper_arm",),
    "el_flex": ("upper_arm", "forearm"),
    "pro_sup": ("forearm",),
    "wr_flex": ("forearm",),
    "wr_dev": ("forearm",),
}
"""Segments spanned by muscles of each joint; a muscle's length scales with their mean; project default, unconfirmed."""
STIFFNESS = 75.0
"""Stiffness of a muscle along its line of action, per muscle force [1/m]; PMC2784227."""
DAMPING_TIME = 0.05
"""Damping of a muscle per stiffness [s]; PMC2784227."""
WIDTH = 8
"""Number of rows that `muscles.c` adds up at once."""
_built = load("hric_muscles")


class MuscleState:
    """State of k muscles and ideal actuators at one instant.

    Attributes:
        arms: moment arms about m joints, shape (k, m) [m]; 1 or -1 for actuators.
        length: fibre length per optimal length, shape (k,) [1]; 0 for actuators.
        velocity: rate of `length`, shape (k,) [1/s]; 0 for actuators.
        gain: force per activation, shape (k,) [N]; torque for actuators [N m].
        passive: force without activation, shape (k,) [N].
        outside: True if a joint angle was outside the range of the fit, and was clipped to the range.
        numbers: length, velocity, gain, passive and arms, concatenated.
    """

    __slots__ = ("_count", "numbers", "outside")

    def __init__(self, out: FloatArray, count: int, outside: bool) -> None:
        self.numbers, self._count, self.outside = out, count, outside

    def _row(self, row: int) -> FloatArray:
        """Return a view of one quantity of all muscles, made on demand, since few cycles need it."""
        return self.numbers[row * self._count : (row + 1) * self._count]

    @property
    def length(self) -> FloatArray:  # noqa: D102  (see Attributes)
        return self._row(0)

    @property
    def velocity(self) -> FloatArray:  # noqa: D102
        return self._row(1)

    @property
    def gain(self) -> FloatArray:  # noqa: D102
        return self._row(2)

    @property
    def passive(self) -> FloatArray:  # noqa: D102
        return self._row(3)

    @property
    def arms(self) -> FloatArray:  # noqa: D102
        return self.numbers[4 * self._count :].reshape(self._count, -1)

    def forces(self, activation: FloatArray) -> FloatArray:
        """Return muscle forces [N] and actuator torques [N m], shape (k,), at activations of shape (k,) [1]."""
        return self.gain * activation + self.passive

    def torque(self, activation: FloatArray) -> FloatArray:
        """Return the joint torques, shape (m,) [N m], at activations of shape (k,) [1]."""
        return np.asarray(self.forces(activation) @ self.arms)


class Intrinsic(NamedTuple):
    """Joint impedance of m joints from the muscles' stiffness, without reflexes.

    Attributes:
        stiffness: shape (m, m) [N m/rad].
        damping: shape (m, m) [N m s/rad].
    """

    stiffness: FloatArray
    damping: FloatArray


class ScaledMuscle(NamedTuple):
    """Muscle scaled to the size and strength of one person.

    Attributes:
        name: name with the side.
        force: maximum isometric force [N].
        optimal_length, slack_length: lengths of fibres and tendon [m].
        scale: ratio of the subject's lengths to the model's [1].
        joints: joints of the body whose angles determine the muscle's length.
        order, coefficients: length polynomial [m], see `Polynomial`.
    """

    name: str
    force: float
    optimal_length: float
    slack_length: float
    scale: float
    joints: tuple[str, ...]
    order: int
    coefficients: tuple[float, ...]


class MuscleSet:
    """Muscles of a body's arms, scaled to the person, and ideal actuators of joints without muscles.

    Args:
        body: body with one or two arms.
        anatomy: fitted muscles of a right arm.
        factor: factor on the muscles' strength [1].

    Attributes:
        names: names of k muscles and actuators, "right_bic_l", "right_wr_flex+".
        is_muscle: True for a muscle, False for an actuator, in the order of `names`.
        muscle_count: number of muscles.
        scaled: muscles scaled to the body, without actuators.
        joints: indices in body.joints of the m joints that muscles and actuators move: the columns of moment arms.
        size: size of `MuscleState.numbers`.
        compiled: object of `muscles.c` with the functions of `at` and `intrinsic`, which write to given arrays.

    Raises:
        HricError: the body has no arm, or the factor is not above 0.
    """

    def __init__(self, body: Body, anatomy: Anatomy, factor: float = 1.0) -> None:
        sides = [side for side in ("right", "left") if f"{side}_upper_arm" in body.segments]
        if not sides:
            raise HricError(f"the body of {body.subject.code} has no arm for muscles; valid: a body with an arm")
        if not factor > 0.0:
            raise HricError(f"the factor on the muscles' strength is {factor}; valid: above 0")
        self._order, self._strength, self._body, self._factor = list(body.joints), strength(body), body, factor
        self.scaled: list[ScaledMuscle] = []
        names, columns, arms, actuators = list[str](), list[str](), [], list[tuple[int, int, float]]()
        products = _Monomials(anatomy)
        for side in sides:
            arms.append(self._arm(anatomy, products, side, len(names), len(columns)))
            names += [f"{side}_{name}" for name in anatomy.muscles]
            columns += [f"{side}_{name}" for name in anatomy.joints]
            for joint in (f"{side}_{row.name}" for row in ARM if row.name not in anatomy.joints):
                index = self._order.index(joint)
                for sense, torques in (("+", self._strength[1]), ("-", self._strength[0])):
                    actuators.append((len(names), len(columns), factor * torques[index]))
                    names.append(f"{joint}{sense}")
                columns.append(joint)
        constant = _constant(len(names), len(columns), actuators)
        self.names, self.joints = tuple(names), tuple(map(self._order.index, columns))
        ideal = {row for row, *_ in actuators}
        self.is_muscle = tuple(row not in ideal for row in range(len(names)))
        self.muscle_count = sum(self.is_muscle)
        self.size = constant.size
        shape = len(names), len(columns), len(self._order)
        self.compiled = _built.Muscles(_curves(), constant, shape, arms)

    def at(self, q: Sequence[float], dq: Sequence[float]) -> MuscleState:
        """Return the state of the muscles at the positions [rad] and velocities [rad/s] of all joints of the body."""
        out = np.empty(self.size)
        return MuscleState(out, len(self.names), self.compiled.at(q, dq, out))

    def intrinsic(self, state: MuscleState, activation: FloatArray) -> Intrinsic:
        """Return the joint impedance that muscles have at activations of shape (k,) [1], without reflexes."""
        stiffness = np.empty((len(self.joints), len(self.joints)))
        self.compiled.stiffness(state.numbers, activation, stiffness, STIFFNESS)
        return Intrinsic(stiffness, DAMPING_TIME * stiffness)

    def _arm(self, anatomy: Anatomy, products: "_Monomials", side: str, row: int, column: int) -> tuple[object, ...]:
        """Return the muscles of one side, as arguments of the type in `muscles.c`."""
        angles = [self._order.index(f"{side}_{name}") for name in anatomy.joints]
        size, term, target, coefficient = products.tiles
        own = [muscle.curves.numbers() for muscle in anatomy.muscles.values() if muscle.curves is not None]
        counts = len(products.factor), len(anatomy.muscles), len(size), len(term)
        integers = np.concatenate([angles, products.factor, products.angle, size, term, target])
        made = [self._scaled(anatomy, muscle, side) for muscle in anatomy.muscles.values()]
        self.scaled += made
        rows = [
            (muscle.force, muscle.optimal_length / muscle.scale, muscle.slack_length / muscle.scale, muscle.scale)
            for muscle in made
        ]
        numbers = [anatomy.lower, anatomy.upper, coefficient, *np.transpose(rows), *own]
        sizes = len(angles), *counts, row, column, bool(own)
        return sizes, integers.astype(np.intc), np.concatenate(numbers)

    def _scaled(self, anatomy: Anatomy, muscle: Muscle, side: str) -> ScaledMuscle:
        length = muscle.length
        spanned = {segment for joint in length.joints for segment in SPANNED[joint] if segment in anatomy.reference}
        ratios = [self._body.segments[f"{side}_{name}"].length / anatomy.reference[name] for name in sorted(spanned)]
        scale = float(np.mean(ratios)) if ratios else 1.0
        subject = self._body.subject
        women = float(np.mean([STRENGTH[joint].women for joint in length.joints]))
        share = women if subject.sex == "female" else 1.0
        return ScaledMuscle(
            f"{side}_{muscle.name}",
            self._factor * mass_factor(subject) * share * muscle.max_force,
            scale * muscle.optimal_length,
            scale * muscle.slack_length,
            scale,
            tuple(f"{side}_{joint}" for joint in length.joints),
            length.order,
            tuple(scale * coefficient for coefficient in length.coefficients),
        )


class _Monomials:
    """Monomials in all length polynomials of an anatomy and in their gradients.

    The first monomial is 1; each other one is an earlier monomial times a joint angle.

    Attributes:
        factor, angle: for each monomial, index of the earlier monomial and of the angle; 0 for the first.
        tiles: sparse matrix of the lengths and their derivatives, see `_tiles`.
    """

    def __init__(self, anatomy: Anatomy) -> None:
        self._joints = anatomy.joints
        highest = {power for muscle in anatomy.muscles.values() for power in self._powers(muscle.length)}
        needed = {power for high in highest for power in product(*(range(exponent + 1) for exponent in high))}
        self._indices = {power: i for i, power in enumerate(sorted(needed, key=lambda power: (sum(power), power)))}
        self.factor, self.angle = [0], [0]
        for power in list(self._indices)[1:]:
            angle = next(i for i, exponent in enumerate(power) if exponent)
            self.factor.append(self._indices[_lowered(power, angle)])
            self.angle.append(angle)
        self.tiles = self._tiles([muscle.length for muscle in anatomy.muscles.values()])

    def _tiles(self, lengths: Sequence[Polynomial]) -> tuple[list[int], list[int], list[int], list[float]]:
        """Return a sparse matrix whose rows are each muscle's length, followed by its derivatives by each angle.

        Up to WIDTH rows with the same monomials are a tile.

        Returns:
            number of monomials of each tile; their indices; the rows of each tile, filled up to WIDTH with the number
                of all rows; for each monomial of each tile its coefficients in these rows, filled up with 0.
        """
        alike: dict[tuple[int, ...], list[tuple[int, list[float]]]] = {}
        count = len(lengths) * (1 + len(self._joints))
        for row, (length, angle) in enumerate(product(lengths, (None, *range(len(self._joints))))):
            entries = {
                self._indices[_lowered(power, angle)]: value if angle is None else value * power[angle]
                for power, value in zip(self._powers(length), length.coefficients, strict=True)
                if angle is None or power[angle]
            }
            alike.setdefault(tuple(entries), []).append((row, list(entries.values())))
        tiles = []
        for monomials, rows in alike.items():
            rows += [(count, [0.0] * len(monomials))] * (-len(rows) % WIDTH)
            tiles += [(monomials, rows[begin : begin + WIDTH]) for begin in range(0, len(rows), WIDTH) if monomials]
        return (
            [len(monomials) for monomials, _ in tiles],
            [index for monomials, _ in tiles for index in monomials],
            [row for _, rows in tiles for row, _ in rows],
            [
                value
                for _, rows in tiles
                for column in zip(*(values for _, values in rows), strict=True)
                for value in column
            ],
        )

    def _powers(self, polynomial: Polynomial) -> list[tuple[int, ...]]:
        return [tuple(power) for power in polynomial.powers(self._joints).tolist()]


def _lowered(power: tuple[int, ...], angle: int | None) -> tuple[int, ...]:
    return power if angle is None else (*power[:angle], power[angle] - 1, *power[angle + 1 :])


def _constant(muscles: int, joints: int, actuators: Iterable[tuple[int, int, float]]) -> FloatArray:
    """Return `MuscleState.numbers` with the values of the actuators, and 0 for the muscles.

    actuators: row (index in names), column (joint) and signed maximum torque [N m] of each.
    """
    out = np.zeros(muscles * (4 + joints))
    arms = out[4 * muscles :].reshape(muscles, joints)
    for row, column, torque in actuators:
        out[2 * muscles + row] = abs(torque)
        arms[row, column] = np.sign(torque)
    return out


def _curves() -> FloatArray:
    """Return the parameters of the muscle curves, as an argument of the type in `muscles.c`."""
    bells = [number for bell in curves.ACTIVE for number in bell]
    passive = curves.PASSIVE_SHAPE, curves.PASSIVE_STRAIN, curves.SHORTEST
    return np.array([*bells, *passive, *curves.VELOCITY, curves.MAX_VELOCITY])
