"""Contact of a person with the arm under chosen conditions: each change runs an experiment again, without a ROS master.

The experiment runs in a process that is kept, so that nothing is loaded again. It is judged as a recorded run is.
"""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import asdict, dataclass
from functools import lru_cache
from multiprocessing import get_context
from typing import Any

from pebble import ProcessExpired, ProcessPool

from hric_assessment.findings import Finding
from hric_assessment.verdict.assess import assess
from hric_assessment.verdict.conclusions import CONTACT, DISTANCE
from hric_assessment.verdict.result import Verdict
from hric_core.errors import FailureError, HricError, check_known
from hric_human.participant.settings import HumanSettings
from hric_report.html.human_and_objects import simulated_person
from hric_report.html.scene import SceneRobot, joint_track
from hric_run.definition import experiment
from hric_run.simulation import Simulation
from hric_sweep.observed import Observations, Observed
from hric_view import page

EXPERIMENT = "try_contact"
TIMEOUT = 60.0
"""Longest duration of one run [s]; project default."""
RATE = 60.0
"""Instants of the replay per second [Hz]."""
PERMITTED = ("permitted speed by m_u [m/s]", "permitted speed by M/2 + m_L [m/s]")
"""Names of the permitted speeds in findings of contacts."""
PD, SUBJECT = "parameters.joint_pd_controller", "human.subject"


@dataclass(frozen=True)
class Slider:
    """Condition that can be chosen.

    Attributes:
        name: short name, key of the value.
        text: label on the page.
        unit: unit of the value.
        lower, upper, default: range and default.
        step: step of the slider.
    """

    name: str
    text: str
    unit: str
    lower: float
    upper: float
    default: float
    step: float


SLIDERS = (
    Slider("stiffness", "stiffness of each joint", "N m/rad", 20.0, 600.0, 200.0, 10.0),
    Slider("speed", "largest joint speed", "rad/s", 0.2, 2.0, 1.0, 0.1),
    Slider("mass", "mass of the person", "kg", 45.0, 120.0, 79.0, 1.0),
    Slider("height", "height of the person", "m", 1.50, 2.00, 1.76, 0.01),
    Slider("female", "body: 0 male, 1 female", "", 0.0, 1.0, 0.0, 1.0),
    Slider("hand", "height of the person's hand", "m", 0.45, 0.73, 0.58, 0.01),
)
"""Conditions; ranges are project defaults: bodies of adults, and postures in which the arm can reach the forearm."""


@dataclass(frozen=True)
class TryoutFigure:
    """Figure of a run.

    Attributes:
        name: name for display.
        value: value in `unit`; None: not known.
        limit: limit in `unit`; None: there is none, or it is not known.
        unit: unit.
        reply: reply of the verdict to the figure's question; "": the figure has none.
        reason: why the reply is as it is, or why the value is not known.
    """

    name: str
    value: float | None
    limit: float | None
    unit: str
    reply: str = ""
    reason: str = ""


def checked(values: Mapping[str, Any]) -> dict[str, float]:
    """Return the conditions of a run, with defaults for missing ones.

    Raises:
        HricError: a condition is unknown, or its value is not a number within its range.
    """
    check_known("condition", values, [slider.name for slider in SLIDERS])
    result = {slider.name: slider.default for slider in SLIDERS} | dict(values)
    for slider in SLIDERS:
        value = result[slider.name]
        if isinstance(value, bool) or not isinstance(value, int | float) or not slider.lower <= value <= slider.upper:
            valid = f"{slider.lower:g} to {slider.upper:g} {slider.unit}".strip()
            raise HricError(f"{slider.text} is {value!r}; valid: {valid}")
    return result


def overrides(values: Mapping[str, float]) -> list[str]:
    """Return the overrides of the experiment, as on the command line, for checked conditions."""
    sex = "female" if values["female"] >= 0.5 else "male"
    body = f"{{code: T01, mass: {values['mass']:g}, height: {values['height']:g}, sex: {sex}}}"
    return [
        f"{PD}.kp:={values['stiffness']:g}",
        f"{PD}.profile.velocity:={values['speed']:g}",
        f"{SUBJECT}:={body}",
        f"human.control.parameters.reference.points.0.3:={values['hand']:g}",
    ]


def run(values: Mapping[str, float]) -> str:
    """Run the experiment and return the scene with its figures, as a message for the page.

    Raises:
        HricError: the run is not possible, or failed.
    """
    definition = experiment.load(EXPERIMENT, overrides(values))
    with Simulation(definition) as simulation:
        observed = Observed(simulation, {"human", "contacts", "impact", "collaboration"})
        simulation.run()
        observations = observed.values()
        error = simulation.app.hw.error
        verdict = assess(observations.verdict_input)
        robots = scene_of(observations, HumanSettings.of(definition.human or {}, "human"))
    notes = [f"The run ended early: {error}"] if error else []
    part = Figures(list(figures_of(verdict)), values)
    return page.scene_message(robots, [part], notes=notes, live=False)


def scene_of(observations: Observations, settings: HumanSettings) -> list[SceneRobot]:
    """Return the arm and the person of a run."""
    log = observations.log
    arm = SceneRobot("", observations.description, log.joint_names, *joint_track(log, RATE))
    person = observations.metrics.person
    return [arm] if person is None else [arm, simulated_person(person, settings, RATE)]


def figures_of(verdict: Verdict) -> Iterator[TryoutFigure]:
    """Return the figures of a verdict: force, speeds and the conclusions."""
    contacts = [
        finding for finding in verdict.findings if finding.group == CONTACT and finding.window and finding.regions
    ]
    conclusions = {one.question: one for one in verdict.conclusions}
    why = "" if contacts else "nothing touched the person"
    force = _largest(contacts, "transient peak [N]")
    if contacts and force is None:
        why = "no force was recorded for one of the contacts"
    yield TryoutFigure("largest contact force", force, None, "N", reason=why)
    allowed = [value for finding in contacts for name in PERMITTED if (value := finding.values.get(name)) is not None]
    speed = _largest(contacts, "speed at which they met [m/s]")
    yield TryoutFigure("speed at which they met", speed, min(allowed, default=None), "m/s", reason=why)
    texts = {CONTACT: "contact, share of its limit", DISTANCE: "smallest distance"}
    for name, one in conclusions.items():
        if name == "task":
            continue  # a run that was made to be short has no task
        yield TryoutFigure(
            texts.get(name, f"{name}: {one.subject}"), one.value, one.limit, one.unit, one.reply, one.reason
        )


def _largest(findings: Sequence[Finding], name: str) -> float | None:
    """Return the largest value of a name; None: one of the findings does not know it, or there is none."""
    values = [finding.values.get(name) for finding in findings]
    known = [value for value in values if value is not None]
    return max(known) if known and len(known) == len(values) else None


class Figures:
    """Part of the page with the figures of a run; see page.Part.

    Args:
        figures: figures of the run.
        values: conditions of the run.
    """

    def __init__(self, figures: list[TryoutFigure], values: Mapping[str, float]) -> None:
        self._figures, self._values = figures, values

    def scene(self) -> dict[str, object]:
        """Return the figures."""
        return {"figures": [asdict(figure) for figure in self._figures], "values": dict(self._values)}

    def frame(self) -> dict[str, object]:
        """Return nothing: there are no frames."""
        return {}


class Tryout:
    """Process that runs the experiment under changing conditions, one run at a time."""

    def __init__(self) -> None:
        self._pool = ProcessPool(max_workers=1, context=get_context("spawn"))
        self._kept = lru_cache(maxsize=16)(self._run)

    def result(self, values: Mapping[str, Any]) -> str:
        """Return the message of a run; one of the last 16 again is not run again.

        Raises:
            HricError: a condition is not valid, or the run failed.
        """
        return self._kept(tuple(sorted(checked(values).items())))

    def close(self) -> None:
        """End the process."""
        self._pool.stop()
        self._pool.join()

    def _run(self, values: tuple[tuple[str, float], ...]) -> str:
        try:
            message: str = self._pool.schedule(run, (dict(values),), timeout=TIMEOUT).result()
        except FutureTimeoutError:
            raise FailureError(f"the run has not ended within {TIMEOUT:g} s and was stopped") from None
        except ProcessExpired as error:
            raise FailureError(f"the process of the run has died ({error}); the next change starts another") from error
        return message
