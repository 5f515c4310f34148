"""The samplers by name.

| kind | for | runs |
|---|---|---|
| grid, list | given values | all; `runs` is left out |
| random | probabilities, with an exact interval | any |
| sobol, lhs | distributions and means of outputs | a power of two; any |
| saltelli | first-order and total indices | n + 2 times a power of two, for n variables |
| tpe | the worst case | about a hundred, in batches |
| cross_entropy, subset | small probabilities | some hundreds or thousands, in batches |

sampler: {kind: sobol}
"""

from typing import Any

from hric_core.parameters import Settings, variant
from hric_sweep.samplers import cross_entropy, designs, subset, tpe
from hric_sweep.samplers.sampler import Sampler
from hric_sweep.space import Space

KINDS: dict[str, type[Settings]] = {
    "grid": designs.Grid,
    "list": designs.Listed,
    "random": designs.Random,
    "sobol": designs.Sobol,
    "lhs": designs.Lhs,
    "saltelli": designs.Saltelli,
    "tpe": tpe.Tpe,
    "cross_entropy": cross_entropy.CrossEntropy,
    "subset": subset.Subset,
}
"""By the word at `kind`."""
SAMPLER: Any = variant("kind", KINDS, text="where the runs are")


def make(settings: Any, space: Space, runs: int | None, seed: int) -> Sampler:
    """A sampler.

    Args:
        settings: one of KINDS, as SAMPLER reads it.
        space: of the variables.
        runs: how many at most; None where the sampler knows it: grid and list.
        seed: of all that it draws.

    Raises:
        ParameterError: what does not go together, with what would.
        HricError: a library of the sampler is not installed.
    """
    made: Sampler = settings.sampler(space, runs, seed)
    return made
