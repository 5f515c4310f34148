"""Tasks of the environments: experiment, goal, duration and constraints of each; and the choice of the person."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from hric_core.errors import HricError, check_known
from hric_core.parameters import mapping, number
from hric_run.definition import experiment, overrides
from hric_run.definition.experiment import Experiment
from hric_run.definition.parameters import overlay
from hric_sweep import populations

REACH = Path(__file__).resolve().parents[2] / "config" / "reach.yaml"
DRAWN, SETPOINTS, HAND = "drawn", "setpoints", "hand"
"""Kinds of goals: a random point, the end effector's position at the experiment's setpoints, the person's motion."""
COSTS = FORCE, SEPARATION, STOPPING, POSTURE, EFFORT = "force", "separation", "stopping", "posture", "effort"
"""Names of the costs of a step, each of which is a share of a limit; see `judge.Costs`."""
START = 0.05
"""Largest random deviation of a joint from its start position at the start of an episode [rad] (project default)."""
RATE = 25.0
"""Rate at which the person publishes joint torques [Hz]: one message per step of STEP, for the cost `effort`."""
CORRELATION = 0.4
"""Correlation of the normal scores of mass and height in a population (project default, unconfirmed)."""
DRAWS = 20
"""Largest number of draws of body and motion at a reset, if the person cannot reach the points (project default)."""
_channels = itertools.count()


@dataclass(frozen=True)
class TaskDefinition:
    """Definition of a task.

    Attributes:
        experiment: name or path of the experiment.
        goal: kind of goal: DRAWN, SETPOINTS or HAND.
        seconds: robot time of an episode [s].
        constraints: names of the costs that have to stay at or below 1.
        changes: overrides of the experiment, `key:=value`.
        text: description for the table of tasks in INTERFACE.md.
        deviation: largest random deviation of a joint from the start position [rad] (project default); 0 where the arm
            holds an object or a grip at the start.
    """

    experiment: str
    goal: str
    seconds: float
    constraints: tuple[str, ...]
    changes: tuple[str, ...]
    text: str
    deviation: float = 0.0


_VARIED = "human.control.parameters.reference.variation:={position: 0.01, time: 0.05}"
_AREA = "human.contact_area:=1.0e-4"
"""Override of the contact area [m^2], as in the experiment contact: edge of the robot's hand (assumed)."""
TASKS = {
    "Reach": TaskDefinition(
        str(REACH),
        DRAWN,
        4.0,
        (FORCE, SEPARATION),
        (_VARIED, _AREA),
        "reach for a random point beside a person who reaches into the workspace",
        START,
    ),
    "HandGuidance": TaskDefinition(
        "hand_guidance",
        HAND,
        7.0,
        (FORCE, EFFORT),
        (_VARIED, _AREA),
        "follow the person who leads the robot's hand",
    ),
    "CoTransport": TaskDefinition(
        "co_transport",
        HAND,
        8.0,
        (FORCE, EFFORT),
        (_VARIED, _AREA),
        "carry one end of a board whose other end the person carries and leads",
    ),
    "Handover": TaskDefinition(
        "handover",
        HAND,
        4.5,
        (FORCE, EFFORT),
        (_VARIED, _AREA),
        "hold out a baton which the person takes and pulls",
    ),
    "Contact": TaskDefinition(
        "contact",
        SETPOINTS,
        3.0,
        (FORCE,),
        (),
        "move to a setpoint through the person's forearm",
        START,
    ),
    "SharedWorkspace": TaskDefinition(
        "shared_workspace",
        SETPOINTS,
        16.0,
        (FORCE, SEPARATION),
        (_VARIED, _AREA),
        "move from side to side while a person walks up and reaches into the workspace",
        START,
    ),
}
"""Tasks by name; the id of a task's environment is hric/NAME-v0."""


TRIALS = (".c3d", ".trc", ".mot")
"""Extensions of files with a recorded trial."""


@dataclass(frozen=True)
class PersonChoice:
    """Choice of the person in an environment.

    Attributes:
        kind: "scripted", the motion of the experiment; "reactive", a hand that takes an object from the arm when the
            arm rests, and draws back when the arm comes near; "trial", the motion of a recorded trial; "policy", a hand
            whose target an agent moves; "none", no person.
        trial: path of a c3d, .trc or .mot file; only with kind "trial".
        population: name of a population from which each episode draws mass, height and sex of the person; empty: those
            of the experiment.
        drive: "torque": joint torques move the person; "muscle": muscles do.
    """

    kind: str = "scripted"
    trial: str = ""
    population: str = ""
    drive: str = "torque"

    def __post_init__(self) -> None:
        check_known("person", [self.kind], ("scripted", "reactive", "trial", "policy", "none"))
        check_known("drive", [self.drive], ("torque", "muscle"))
        if bool(self.trial) != (self.kind == "trial"):
            raise HricError(
                f"trial is {self.trial!r} with person={self.kind!r}; valid: a path with person='trial', else none"
            )
        if self.trial and Path(self.trial).suffix not in TRIALS:
            raise HricError(f"trial is {self.trial!r}; valid: a file with the extension {' or '.join(TRIALS)}")
        if self.population:
            check_known("population", [self.population], populations.names())
        for name, usual in (("population", ""), ("drive", "torque")):
            if self.kind == "none" and (value := getattr(self, name)) != usual:
                raise HricError(f"{name} is {value!r} with person='none'; valid: another person, or {name}={usual!r}")


@dataclass(frozen=True)
class Scene:
    """Experiment of an environment with the chosen person.

    Attributes:
        definition: the experiment, without setpoints and supervisor.
        intention: motion program of the person's hand; None: it is not known, or there is no person.
        channel: key of the hand's target in `guided.TARGETS`; empty: no agent moves it.
        setpoints: (time [s], joint positions [rad]) of the experiment.
    """

    definition: Experiment
    intention: Mapping[str, Any] | None
    channel: str
    setpoints: tuple[tuple[float, tuple[float, ...]], ...]


def checked_step(step: Any) -> float:
    """Return the time between two actions [s]. Raises HricError if it is not a multiple of 1 ms, above 0 to 1 s."""
    plain = step.item() if isinstance(step, np.generic) else step
    period: float = number(above=0.0, maximum=1.0, unit="s").checked(plain, "step")
    if period < 0.5e-3 or abs(round(1e3 * period) - 1e3 * period) > 1e-6:
        raise HricError(f"step is {step} s; valid: a multiple of 0.001 s")
    return period


def checked_weights(weights: Any) -> dict[str, float]:
    """Return weights of costs by name [1]. Raises HricError if they are not finite numbers of 0 or more for COSTS."""
    values: dict[str, float] = mapping(number(minimum=0.0)).checked(weights, "weights")
    check_known("cost", values, COSTS)
    return values


def scene(
    task: TaskDefinition,
    choice: PersonChoice,
    controller: str,
    parameters: Mapping[str, object],
    changes: Sequence[str],
) -> Scene:
    """Return the experiment of a task with the chosen person and the controller of the action mode.

    Args:
        task: the task.
        choice: the person.
        controller: name of the controller.
        parameters: its parameters, which replace those of the experiment.
        changes: overrides of the experiment, `key:=value`, in addition to those of the task and to `parameters`.

    Raises:
        HricError: the task needs a person, or a change or a file has a mistake, or a change has no effect.
    """
    _check_effect(task, choice, changes)
    common = ("simulator:=mujoco", "robot.parameters.control_log:=false", f"human.rate:={RATE}")
    others = [text for text in changes if _section(text) != "parameters"]
    definition = experiment.load(task.experiment, [*common, *task.changes, *others])
    setpoints = tuple((item.time, item.positions) for item in definition.setpoints)
    definition = replace(definition, supervisor=None, setpoints=())
    own = overlay(definition.parameters.get(controller, {}), parameters)
    definition = _commanded(definition, controller, own, [text for text in changes if text not in others])
    human = dict(definition.human or {})
    reference = dict(human["control"]["parameters"]["reference"])
    channel = ""
    if choice.kind == "none":
        human = {}
    else:
        human["drive"] = choice.drive
        channel = _choose(human, reference, choice)
    shown = {key: value for key, value in reference.items() if key != "oriented"}
    intention = shown if human and choice.kind in ("scripted", "policy") else None
    if task.goal == HAND and intention is None:
        raise HricError(
            f"the goal of {definition.name} is the motion of the person, which is not known with "
            f"person={choice.kind!r}; valid: scripted, policy"
        )
    if task.goal == SETPOINTS and not setpoints:
        raise HricError(f"the experiment {definition.name} has no setpoint to use as goal; valid: one or more")
    return Scene(replace(definition, human=human or None), intention, channel, setpoints)


def _commanded(
    definition: Experiment, controller: str, parameters: Mapping[str, object], changes: Sequence[str]
) -> Experiment:
    """Return an experiment with another controller and its parameters, to which changes are applied."""
    used = (controller,)
    changed = overrides.apply({"controllers": used, "parameters": {controller: parameters}}, changes)
    return replace(definition, controllers=used, parameters=changed["parameters"])


def _section(change: str) -> str:
    """Return the section of the experiment in which an override changes a key."""
    key = change.partition(":=")[0]
    return overrides.SHORTCUTS.get(key, (key,))[0].partition(".")[0]


def _check_effect(task: TaskDefinition, choice: PersonChoice, changes: Sequence[str]) -> None:
    """Raise HricError if a change is one of a section that the environment does not use."""
    is_list = isinstance(changes, Sequence) and not isinstance(changes, str)
    if not is_list or not all(isinstance(text, str) for text in changes):
        raise HricError(f"changes is {changes!r}; valid: a list of overrides, each key:=value")
    valid = {"parameters", "robot", *(["setpoints"] if task.goal == SETPOINTS else [])}
    valid |= {"human"} if choice.kind != "none" else set()
    replaced = {"human.drive": "the argument drive instead", "human.rate": f"{RATE:g} Hz, which the costs need"}
    replaced |= {"human.subject": "no population"} if choice.population else {}
    replaced |= {"human.control.parameters.reference": "another trial"} if choice.trial else {}
    for text in changes:
        if _section(text) not in valid:
            raise HricError(
                f"the change {text!r} has no effect in this environment; valid: keys of {', '.join(sorted(valid))}"
            )
        for key, instead in replaced.items():
            if text.startswith((f"{key}:=", f"{key}.")):
                raise HricError(f"the change {text!r} is not possible; valid: {instead}")


def _choose(human: dict[str, Any], reference: Mapping[str, Any], choice: PersonChoice) -> str:
    """Change the section `human` of an experiment to the chosen person; return `Scene.channel`."""
    control = human["control"]
    parameters = dict(control["parameters"])
    first = [float(value) for value in reference["points"][0][1:4]]
    channel = f"channel{next(_channels)}" if choice.kind == "policy" else ""
    if choice.kind == "trial":
        parameters["reference"] = {"program": Path(choice.trial).suffix.lstrip("."), "path": choice.trial}
    elif choice.kind in ("reactive", "policy"):
        if human.get("walk"):
            raise HricError(
                f"the task needs a walking person, which person={choice.kind!r} is not; valid: scripted, trial, none"
            )
        del parameters["reference"]
        parameters |= {"channel": channel, "start": first}
        control, human["watches"] = control | {"type": "hric_gym/GuidedArm"}, "panda_hand"
    human["control"] = control | {"parameters": parameters}
    return channel


def drawn_body(definition: Experiment, population: str, random: np.random.Generator) -> Experiment:
    """Return an experiment whose person has a mass, height and sex drawn from a population.

    Args:
        definition: experiment with a person.
        population: name of the population.
        random: random generator.
    """
    a, b = random.standard_normal(2)
    scores = a, CORRELATION * a + (1.0 - CORRELATION**2) ** 0.5 * b
    part = population
    if population == "adult_mixed":
        part = str(random.choice(["adult_female", "adult_male"]))
    mass, height = (
        float(populations.quantity(part, name).ppf(np.array([ndtr(score)]))[0])
        for name, score in zip(("mass", "height"), scores, strict=True)
    )
    subject = {"code": "S0", "mass": mass, "height": height, "sex": part.removeprefix("adult_")}
    return replace(definition, human={**(definition.human or {}), "subject": subject})
