"""Figures of a run, for its HTML page and for print; all modules of this package are found and used.

Modules outside the workspace add figures, too, if they can be imported and their names begin with `hric_figures_`. Each
module has a function `figures` that takes `FigureData` and returns a list of `Figure`, empty if the run lacks the data.
"""

import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module

from hric_analysis.human import SimulatedPerson
from hric_analysis.metrics import Move
from hric_analysis.recordings import Signal
from hric_analysis.tracking_run import MarkerTracking
from hric_bags.reader import RunRecord
from hric_bags.records.safety_record import SafetyRecord
from hric_core.errors import FailureError
from hric_report import sections
from hric_report.figure import Figure

OUTSIDE = "hric_figures_"
"""Prefix of the names of modules outside the workspace that add figures."""


@dataclass(frozen=True)
class FigureData:
    """Data of a run for its figures.

    Attributes:
        record: recording of the run.
        moves: setpoints of the run.
        limits: values of the limits, by joint and by kind of limit.
        tolerances: bands of the settling time, drawn in the figure of the setpoint errors [rad].
        person: data of the simulated human; None: there was none.
        safety: decisions of the safety supervisor; None: there was none.
        followed: data of marker tracking; None: the robot followed no marker.
        signals: sensor signals.
    """

    record: RunRecord
    moves: Sequence[Move]
    limits: Mapping[str, Mapping[str, float]]
    tolerances: Sequence[float] = ()
    person: SimulatedPerson | None = None
    safety: SafetyRecord | None = None
    followed: MarkerTracking | None = None
    signals: Sequence[Signal] = ()


def of_run(data: FigureData) -> list[Figure]:
    """Return the figures of all modules, in the order of the report's sections.

    Raises:
        HricError: a module outside the workspace cannot be imported, or its figures cannot be made.
    """
    made = [figure for module in _modules() for figure in _figures(module)(data)]
    return sorted(made, key=lambda figure: sections.ORDER.index(figure.section or sections.OTHER))


def _modules() -> list[str]:
    inside = [f"{__name__}.{module.name}" for module in pkgutil.iter_modules(__path__)]
    return [*inside, *sorted(module.name for module in pkgutil.iter_modules() if module.name.startswith(OUTSIDE))]


def _figures(module: str) -> Callable[[FigureData], list[Figure]]:
    try:
        made: Callable[[FigureData], list[Figure]] = import_module(module).figures
    except Exception as error:  # a module outside the workspace may raise any error
        raise FailureError(f"cannot import the figures of the module {module}: {error}") from error
    return made
