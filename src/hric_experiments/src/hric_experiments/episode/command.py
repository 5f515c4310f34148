"""Command `hric import`: writes an experiment that replays an episode of a data set."""

import argparse
from pathlib import Path

from hric_bags import files
from hric_core.command import Argument, Command
from hric_core.errors import HricError


class ImportCommand(Command):
    """Write an experiment in which the emulated Panda moves as in an episode of a LeRobot data set.

    `hric run FILE` runs the experiment. The joint positions pass through the emulated control box; if it stops the
    motion by a reflex, the report of the run names it.
    """

    def arguments(self) -> list[Argument]:
        """Return the data set and the options of `hric import`."""
        return [
            Argument("dataset", type=Path, metavar="DATASET", help="folder of a LeRobot data set, version 2 or 3"),
            Argument("--episode", type=int, default=0, metavar="N", help="number of the episode (default: 0)"),
            Argument(
                "--feature",
                default="observation.state",
                metavar="NAME",
                help="feature with the joint positions [rad] (default: observation.state)",
            ),
            Argument(
                "--signals",
                nargs="+",
                default=[],
                metavar="SIGNAL",
                help="names or indices of the seven joint positions in the feature (default: by their names)",
            ),
            Argument(
                "-o",
                "--output",
                type=Path,
                metavar="FILE",
                help="experiment file; the positions are written next to it (default: DATASET_N.yaml in this folder)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Write experiment and trajectory file, and print their paths."""
        from hric_experiments.episode import lerobot

        joints = [f"panda_joint{k}" for k in range(1, lerobot.ARM + 1)]
        number, dataset = arguments.episode, arguments.dataset.resolve()
        episode = lerobot.read(dataset, number, joints, arguments.feature, arguments.signals)
        path: Path = arguments.output or Path(f"{dataset.name}_{number}.yaml")
        if path.suffix not in (".yaml", ".yml"):
            raise HricError(f"--output is {path}; valid: a file name .yaml")
        trajectory = path.with_suffix(".csv")
        if existing := next(filter(Path.exists, (path, trajectory)), None):
            raise HricError(f"{existing} exists; valid: another name with --output")
        files.make_folder(path.parent)
        with files.atomic(trajectory) as new:
            episode.motion.write(new)
        files.write_yaml(path, episode.experiment(f"episode {number} of {dataset.name}", trajectory.name))
        if not lerobot.PANDA.search(episode.robot):
            robot = f"is {episode.robot!r}" if episode.robot else "is not known"
            print(
                f"robot_type of {dataset.name} {robot}; valid: a Panda or FR3. "
                "On another arm the same joint angles lead to other poses"
            )
        frames = len(episode.motion.time)
        print(f"{frames} frames at {episode.rate:g} Hz: {episode.task or 'task not known'}\n{trajectory}\n{path}")
