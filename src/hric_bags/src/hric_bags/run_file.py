"""Types of the contents of run.yaml, with the definition of the experiment.

Any key may be missing, because older versions wrote fewer.
"""

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

NodeParameters = Mapping[str, Any]
"""Parameters of a node, controller or plugin, or a tree of them; only the node or plugin itself checks them."""


class RobotDefinition(TypedDict, total=False):
    """Section `robot` of an experiment's definition; q_start: start positions in joint order, or by joint [rad]."""

    q_start: Sequence[float] | Mapping[str, float] | None
    hw: str
    arm_id: str
    plant_type: str
    plant: NodeParameters
    description: NodeParameters


class Definition(TypedDict, total=False):
    """Definition of an experiment as it ran, with the keys of its file; duration in [s]."""

    robot: RobotDefinition
    controllers: Sequence[str]
    setpoints: Sequence[NodeParameters]
    metrics: NodeParameters
    duration: float
    arms: Mapping[str, NodeParameters]
    mocap: NodeParameters | None
    force_plate: NodeParameters | None
    human: NodeParameters | None
    person: NodeParameters | None


class RunNotes(TypedDict, total=False):
    """Entries of run.yaml on why a run ended: reason of a stop, error of the program, error of the arm."""

    reason: str
    error: str
    arm_error: str


class Refinement(TypedDict):
    """Comparison of a run with its twin of half the time step [s]: name of its run folder, and the compared values."""

    run: str
    time_step: float
    values: Sequence[NodeParameters]


class RunFile(RunNotes, total=False):
    """Contents of run.yaml.

    interval: begin and end of the robot time that the metrics cover [s]; limits: by joint; trials: replayed trials by
    name of the file, see `hric_core.trial.description`.
    """

    experiment: str
    study: str
    description: str
    mode: str
    status: str
    started: str
    finished: str | None
    subject: str
    notes: str
    arguments: Sequence[str]
    seed: int
    bag: str
    bags: Sequence[str]
    definition: Definition
    trials: Mapping[str, Mapping[str, Any]]
    parameters: NodeParameters
    limits: Mapping[str, Mapping[str, float]]
    versions: Mapping[str, str]
    revision: Mapping[str, str | bool] | None
    platform: Mapping[str, str | int | None]
    real_time_factor: float | None
    interval: Sequence[float] | None
    state_sha256: str
    salvaged: bool
    refined: Refinement


def with_own(common: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of one of several robots: what they have in common, and its own; mappings are merged."""
    groups = {
        key: {**common[key], **value}
        for key, value in own.items()
        if isinstance(value, Mapping) and isinstance(common.get(key), Mapping)
    }
    return {**common, **own, **groups}


def robots(definition: Definition | Mapping[str, Any]) -> list[NodeParameters]:
    """Return the robots of an experiment: those of its arms, or the only one."""
    common = definition.get("robot") or {}
    return [with_own(common, arm.get("robot") or {}) for arm in (definition.get("arms") or {}).values()] or [common]


def held_mass(definition: Definition | Mapping[str, Any]) -> float:
    """Return the mass that the arm holds [kg]: its configured load, or the payloads of the plant if these are heavier.

    Of several arms, the largest counts, which is the safe choice.
    """

    def mass(part: Any) -> float:
        return float(sum(load.get("mass", 0.0) for load in (part if isinstance(part, list) else [part or {}])))

    return max(
        max(mass(robot.get("load")), mass((robot.get("plant") or {}).get("payload"))) for robot in robots(definition)
    )


def robot_parameters(run: RunFile) -> NodeParameters:
    """Return the parameters of the robot's node in a run; empty: run.yaml has none."""
    return (run.get("parameters") or {}).get("robot") or {}
