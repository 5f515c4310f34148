"""First-order and total Sobol indices of each output, for a sweep with Saltelli's design."""

from dataclasses import dataclass

import numpy as np

from hric_core.errors import HricError
from hric_report.html.chart import Axis
from hric_sweep.page.study import RecordedSweep
from hric_sweep.page.words import SALTELLI
from hric_sweep.space import Space
from hric_sweep.statistics.sensitivity import Index, indices
from hric_sweep.variables import Variable

LEFT, RIGHT = 110.0, 368.0
"""Ends of the axis of a chart [units of the picture]."""


@dataclass(frozen=True)
class OutputIndices:
    """Sobol indices of one output.

    Attributes:
        name: name of the output.
        label: name and unit.
        indices: (variable, its indices), the largest total index first; empty: none could be computed.
        error: reason why no indices could be computed.
    """

    name: str
    label: str
    indices: list[tuple[str, Index]]
    error: str = ""

    @property
    def axis(self) -> Axis:
        """Axis of the chart; it includes 0, 1 and all intervals."""
        ends = [end for _, each in self.indices for end in (*each.first_interval, *each.total_interval)]
        return Axis(min(0.0, *ends), max(1.0, *ends), LEFT, RIGHT)


def outputs(study: RecordedSweep) -> list[OutputIndices]:
    """Return the indices of each output that varies; empty if the sweep has another design or is incomplete."""
    if study.sampler != SALTELLI or study.runs != (study.planned or study.runs):
        return []
    vary = study.section["vary"]
    space = Space({name: Variable.of(settings, f"vary.{name}") for name, settings in vary.items()}, ())
    return [_indices(study, space, name) for name in study.outputs if not study.constant(name)]


def _indices(study: RecordedSweep, space: Space, name: str) -> OutputIndices:
    try:
        computed = indices(space, np.asarray(study.columns[name], dtype=float))
    except HricError as error:
        return OutputIndices(name, study.label(name), [], str(error))
    return OutputIndices(name, study.label(name), sorted(computed.items(), key=lambda item: -item[1].total))
