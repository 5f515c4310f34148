"""Commands `schema` (JSON schema of files) and `describe` (parameters and descriptions of an experiment)."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from hric_core import plugins
from hric_core.command import Argument, Command
from hric_core.errors import HricError, check_known
from hric_core.parameters import Settings, json_schema, read_yaml
from hric_experiments.cli import experiment_arguments, log_to_terminal, sort_words
from hric_run.definition import experiment, overrides
from hric_sweep.study import definition as study

DESCRIBED = {
    "robot": "robot",
    "limits": "joint_limits",
    "controllers": "controllers",
    "mocap": "mocap",
    "human_muscles": "human_muscles",
}
"""Choices of `describe` that are printed as YAML, with the name of the function in `parameters` that returns them."""
ENGINE = "simulator:=mujoco"
"""Override of the physics engine that `describe mjcf` uses, as only MuJoCo has scenes in MJCF."""
WORDS = (
    "urdf",
    "human_urdf",
    "mjcf",
    *DESCRIBED,
    "natnet_client",
    "emulated_human",
    "synchronizer",
    "person",
    "supervisor",
)
"""Choices of `hric describe` without the nodes of sensors, whose packages are slow to import; the last five are nodes.
"""


class SchemaCommand(Command):
    """Print the JSON schema of experiment files, with which editors complete and check such files."""

    epilog = (
        "An editor with a YAML language server finds the schema by the first line of the file, for example\n"
        "  # yaml-language-server: $schema=experiment.schema.json"
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("--study", action="store_true", help="print the schema of study files"),
            Argument("--sweep", action="store_true", help="print the schema of sweep files"),
            Argument("--example", action="store_true", help="print a small example file instead"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Print the JSON schema of experiment, study or sweep files, or an example."""
        if arguments.study and arguments.sweep:
            raise experiment.ExperimentError("--study and --sweep exclude each other; valid: one of them")
        kind: type[Settings] = study.Study if arguments.study else experiment.Experiment
        example = study.EXAMPLE if arguments.study else experiment.EXAMPLE
        if arguments.sweep:
            from hric_sweep.definition import EXAMPLE, Sweep

            kind, example = Sweep, EXAMPLE
        print(example if arguments.example else json.dumps(json_schema(kind), indent=2) + "\n", end="")


class DescribeCommand(Command):
    """Print descriptions or parameters that an experiment sets on the parameter server, for launch files."""

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument(
                "what",
                complete=_words,
                help=f"a description (URDF or MJCF), or parameters (YAML): {', '.join(WORDS)}, or a node of a sensor, "
                "e.g. emg",
            ),
            *experiment_arguments(
                f"one of: {', '.join(experiment.names())}; none: the bring-up without experiment; or the path of a "
                "YAML file"
            ),
            Argument(
                "--also",
                action="append",
                default=[],
                metavar="KEY:=VALUE",
                help="also print this parameter; may be repeated",
            ),
            Argument("--also-file", type=Path, metavar="FILE", help="also print the parameters of this YAML file"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Print the chosen description or parameters of the experiment."""
        if arguments.what not in WORDS:
            check_known("description", [arguments.what], _words())
        sort_words(arguments)
        log_to_terminal(quiet=False)
        if arguments.what == "mjcf":
            print(_mjcf(arguments.experiment, arguments.overrides), end="")
            return
        definition = experiment.load(arguments.experiment, arguments.overrides)
        from hric_run.definition import parameters, robot_description

        if arguments.what == "urdf":
            print(robot_description.of_experiment(definition))
        elif arguments.what == "human_urdf":
            print(parameters.human_description(definition))
        else:
            if arguments.what in DESCRIBED:
                values = getattr(parameters, DESCRIBED[arguments.what])(definition)
            else:
                values = parameters.other_nodes(definition).get(arguments.what, {})
            print(yaml.safe_dump({**values, **_also(arguments.also_file, arguments.also)}, sort_keys=False), end="")


def _mjcf(name: str, changes: Sequence[str]) -> str:
    """Return the scene at the start of an experiment as MJCF. Raises HricError if its engine is not MuJoCo.

    Args:
        name: name or path of the experiment.
        changes: overrides `KEY:=VALUE`.
    """
    from hric_run.simulation import Simulation

    chosen = any(change.startswith("simulator:=") for change in changes)
    with Simulation(experiment.load(name, changes if chosen else [*changes, ENGINE])) as simulation:
        plant: Any = simulation.app.hw.plant
        if not hasattr(plant, "mjcf"):
            raise HricError(f"{type(plant).__name__} has no MJCF; valid: {ENGINE}")
        return str(plant.mjcf())


def _words() -> list[str]:
    """Return all choices of `hric describe`, with the nodes of sensors."""
    sensors: list[Any] = [plugins.find(plugins.SENSOR, name) for name in plugins.names(plugins.SENSOR)]
    return [*WORDS, *(name for sensor in sensors for name in (sensor.name, sensor.emulated_name))]


def _also(path: Path | None, words: Sequence[str]) -> dict[str, object]:
    """Return the parameters of a YAML file (None: none), overridden by `KEY:=VALUE` words of the command line."""
    content: object = {} if path is None else read_yaml(path)
    if not isinstance(content, dict):
        raise experiment.ExperimentError(f"{path} must be a mapping of parameters to values")
    return content | dict(map(overrides.split, words))
