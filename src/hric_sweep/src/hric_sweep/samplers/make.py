"""Registry of the samplers by the name that a sweep file uses.

| kind | purpose | runs |
|---|---|---|
| grid, list | listed values | all; `runs` is left out |
| random | probabilities, with an exact interval | any |
| sobol, lhs | distributions and means of outputs | a power of two; any |
| saltelli | first-order and total indices | n + 2 times a power of two, for n variables |
| tpe | the worst case | about a hundred, in batches |
| cross_entropy, subset | small probabilities | some hundreds or thousands, in batches |

sampler: {kind: sobol}
"""

from typing import Any

from hric_core.parameters import variant
from hric_sweep.registry import Kinds
from hric_sweep.samplers import cross_entropy, designs, subset, tpe
from hric_sweep.samplers.sampler import Sampler
from hric_sweep.space import Space

KINDS = Kinds(
    {
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
)
"""Settings class of each sampler, by the value of `kind`; `kind: MODULE:CLASS` names one of another package."""
SAMPLER: Any = variant("kind", KINDS, text="sampler that chooses the values of the variables")


def make(settings: Any, space: Space, runs: int | None, seed: int) -> Sampler:
    """Create the sampler that the settings choose.

    Args:
        settings: settings of a sampler, an instance of a class in KINDS.
        space: variables with their distributions and correlations.
        runs: maximum number of runs; None if the sampler (grid, list) determines it.
        seed: seed of all random draws.

    Raises:
        ParameterError: settings, variables and runs do not fit together; the message lists what is valid.
        HricError: a library of the sampler is not installed.
    """
    made: Sampler = settings.sampler(space, runs, seed)
    return made
