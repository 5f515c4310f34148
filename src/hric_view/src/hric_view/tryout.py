"""Runs of `hric try`: the experiment try_contact, a contact of arm and person, under conditions that a viewer chooses.

It runs headless in a worker process, which is reused so that nothing is loaded again, and is assessed as by
`hric assess`.
"""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import TimeoutError as FutureTimeoutError
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

from pebble import ProcessExpired

from hric_analysis.human import SimulatedPerson
from hric_assessment.verdict.assess import assess
from hric_core.errors import FailureError, HricError, check_known
from hric_human.participant.settings import HumanSettings
from hric_report.html.human_and_objects import simulated_person
from hric_report.html.scene import SceneRobot, joint_track
from hric_run.definition import experiment
from hric_run.simulation import Simulation
from hric_sweep.engines.pebble_engine import worker_pool
from hric_sweep.observed import Observations, Observed
from hric_sweep.outputs import IMPACT
from hric_sweep.task import reason
from hric_view import page
from hric_view.tryout_figures import TryoutFigure, figures_of

EXPERIMENT = "try_contact"
TIMEOUT = 60.0
"""Longest duration of one run [s]; project default."""
MEMORY = 4 * 2**30
"""Memory limit of the worker process [bytes]; project default."""
RATE = 60.0
"""Rate of the replayed instants [Hz of robot time]; project default."""
PD, SUBJECT = "parameters.joint_pd_controller", "human.subject"
SEXES = ("male", "female")


@dataclass(frozen=True)
class Slider:
    """Condition of a run that the viewer can choose on the page.

    Attributes:
        name: short name, the key of the value in messages.
        text: label on the page.
        unit: unit of the value; "": none.
        lower, upper, default: range and default in `unit`.
        step: step of the slider in `unit`.
        choices: words for the values 0, 1, ..., of which the page shows a list; empty: the page shows a slider.
    """

    name: str
    text: str
    unit: str
    lower: float
    upper: float
    default: float
    step: float
    choices: tuple[str, ...] = ()


SLIDERS = (
    Slider("stiffness", "stiffness of each joint", "N m/rad", 20.0, 600.0, 200.0, 10.0),
    Slider("speed", "largest joint speed", "rad/s", 0.2, 2.0, 1.0, 0.1),
    Slider("mass", "mass of the person", "kg", 45.0, 120.0, 79.0, 1.0),
    Slider("height", "height of the person", "m", 1.50, 2.00, 1.76, 0.01),
    Slider("sex", "sex of the person", "", 0.0, 1.0, 0.0, 1.0, choices=SEXES),
    Slider("hand", "height of the person's hand", "m", 0.45, 0.73, 0.58, 0.01),
)
"""All conditions. The ranges are project defaults: sizes of adults, and hand heights at which the arm reaches the
forearm."""


def checked(values: Mapping[str, Any]) -> dict[str, float]:
    """Return the conditions of a run by `Slider.name`, checked, with defaults for missing ones.

    Raises:
        HricError: a condition is unknown, or its value is not a number within its range.
    """
    check_known("condition", values, [slider.name for slider in SLIDERS])
    result = {slider.name: slider.default for slider in SLIDERS} | dict(values)
    for slider in SLIDERS:
        value = result[slider.name]
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not slider.lower <= value <= slider.upper or (slider.choices and value % 1.0):
            valid = f"{slider.lower:g} to {slider.upper:g} {slider.unit}".strip()
            raise HricError(f"{slider.text} is {value!r}; valid: {valid}")
    return result


def overrides(values: Mapping[str, float]) -> list[str]:
    """Return the overrides `KEY:=VALUE` of the experiment for checked conditions."""
    sex = SEXES[round(values["sex"])]
    body = f"{{code: T01, mass: {values['mass']:g}, height: {values['height']:g}, sex: {sex}}}"
    return [
        f"{PD}.kp:={values['stiffness']:g}",
        f"{PD}.profile.velocity:={values['speed']:g}",
        f"{SUBJECT}:={body}",
        f"human.control.parameters.reference.points.0.3:={values['hand']:g}",
    ]


def run(values: Mapping[str, float]) -> str:
    """Run the experiment and return the replay with its figures, as a message for the page in JSON.

    Args:
        values: checked conditions.

    Raises:
        HricError: the run is not possible, or failed.
    """
    definition = experiment.load(EXPERIMENT, overrides(values))
    with Simulation(definition) as simulation:
        observed = Observed(simulation, {IMPACT})
        simulation.run()
        observations = observed.values()
        error = simulation.app.hw.error
        verdict = assess(observations.verdict_input, muscles=False)
        robots = scene_of(observations, HumanSettings.of(definition.human or {}, "human"))
    notes = [f"The run ended early: {error}"] if error else []
    return page.scene_message(robots, [Figures(list(figures_of(verdict)), values)], notes=notes, live=False)


def scene_of(observations: Observations, settings: HumanSettings) -> list[SceneRobot]:
    """Return arm and person of a run with their motions, for the replay."""
    log = observations.log
    arm = SceneRobot("", observations.description, log.joint_names, *joint_track(log, RATE))
    records = observations.verdict_input.recording.humans.values()  # read already, unlike observations.metrics.person
    return [arm, *(simulated_person(SimulatedPerson(record), settings, RATE) for record in records)]


class Figures:
    """Part of the page with the figures of a run; see page.Part.

    Args:
        figures: figures (key values) of the run, see tryout_figures.
        values: checked conditions of the run.
    """

    def __init__(self, figures: list[TryoutFigure], values: Mapping[str, float]) -> None:
        self._figures, self._values = figures, values

    def scene(self) -> dict[str, object]:
        """Return figures and conditions of the run for the page."""
        return {"figures": [asdict(figure) for figure in self._figures], "values": dict(self._values)}

    def frame(self) -> dict[str, object]:
        """Return an empty dictionary: a recorded run has no frames."""
        return {}


class Tryout:
    """Worker process that runs the experiment under changing conditions, one run at a time.

    Args:
        execute: function that returns the message of a run with these conditions, such as `run`.
        timeout: longest duration of one run [s].
    """

    def __init__(self, execute: Callable[[Mapping[str, float]], str] = run, timeout: float = TIMEOUT) -> None:
        self._execute, self._timeout, self._renewing = execute, timeout, threading.Lock()
        self._pool = worker_pool(1, MEMORY)
        self._kept = lru_cache(maxsize=16)(self._run)

    def result(self, values: Mapping[str, Any]) -> str:
        """Return the message of a run with these conditions; the last 16 results are reused.

        Raises:
            HricError: a condition is not valid, or the run failed.
        """
        return self._kept(tuple(sorted(checked(values).items())))

    @property
    def alive(self) -> bool:
        """True if the worker process is running; if not, the next run starts another one."""
        return bool(self._pool.active)

    def close(self) -> None:
        """Stop the worker process."""
        self._pool.stop()
        self._pool.join()

    def _run(self, values: tuple[tuple[str, float], ...]) -> str:
        with self._renewing:
            if not self.alive:  # its process has died between two runs
                self._pool = worker_pool(1, MEMORY)
        try:
            message: str = self._pool.schedule(self._execute, (dict(values),), timeout=self._timeout).result()
        except FutureTimeoutError:
            raise FailureError(f"the run was stopped, since it took more than {self._timeout:g} s") from None
        except (ProcessExpired, BrokenProcessPool) as error:
            raise FailureError(
                f"the process of the run has died ({error}); change a condition to start another"
            ) from error
        except HricError:
            raise
        except Exception as error:  # it ends this run, not the page
            raise FailureError(f"the run failed because of a programming error: {reason(error)}") from error
        return message
