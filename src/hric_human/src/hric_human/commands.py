"""Commands `body` and `fit_muscles`."""

import argparse
from pathlib import Path

from hric_core.command import Argument, Command
from hric_human.body import describe, load


class BodyCommand(Command):
    """Print the description of a subject's body as URDF.

    Example: hric body subject.yaml > human.urdf
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("subject", type=Path, help="YAML file of the subject (keys: INTERFACE.md of hric_human)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Print the URDF of the subject's body."""
        print(describe(load(arguments.subject)).urdf)


class FitMusclesCommand(Command):
    """Fit the muscles of a right arm from an OpenSim or MuJoCo model.

    Example: hric fit_muscles arm26.osim arm26.json
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("model", type=Path, help="OpenSim (.osim) or MuJoCo (.xml) model of a right arm"),
            Argument("output", type=Path, help="file to write, for `anatomy` of the human's muscles"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Fit the muscles to those of the model and write them to the output file."""
        from hric_human.muscles.fitting.models import run  # slow to import, so mistakes in the arguments come first

        run(arguments.model, arguments.output)
