"""Option `hric run --refine`: a second run (twin) with half the time step, which gives the verdict error bars."""

import argparse

from hric_assessment.verdict import opened
from hric_assessment.verdict.assess import judge
from hric_assessment.verdict.refined import line, refinement
from hric_bags.run_folder import RunFolder
from hric_control.plants import PlantConfig
from hric_report import headless
from hric_run.definition import experiment
from hric_run.definition.experiment import Experiment

TIME_STEP = "robot.plant.time_step"
"""Key of the time step of the plant in an experiment."""


def run_twin(definition: Experiment, arguments: argparse.Namespace) -> tuple[RunFolder, float]:
    """Run an experiment with half the time step; return the run folder and that time step [s].

    Raises:
        HricError: the experiment has no simulated person, or the run fails.
        KeyboardInterrupt: Ctrl-C.
    """
    if definition.human is None:
        raise experiment.ExperimentError(
            f"--refine compares contacts and distances of a simulated person; {definition.name} has no section human"
        )
    plant = PlantConfig.of({k: v for k, v in definition.robot.plant.items() if k == "time_step"}, "robot.plant.")
    step = 0.5 * plant.time_step
    words = [word for word in arguments.overrides if not word.startswith(f"{TIME_STEP}:=")] + [f"{TIME_STEP}:={step!r}"]
    result = headless.run(
        experiment.load(arguments.experiment, words),
        words,
        seed=arguments.seed,
        root=arguments.runs,
        progress=not arguments.quiet,
        figures=False,
    )
    if result.interrupted:
        raise KeyboardInterrupt
    return result.folder, step


def add_errors(folder: RunFolder, twin: RunFolder, step: float) -> None:
    """Write the differences between a run and its twin to the run's run.yaml, and print the error bars.

    Args:
        folder: run folder of the run.
        twin: run folder of the twin.
        step: time step of the twin's plant [s].
    """
    values = refinement(*(judge(opened(str(path))).findings for path in (folder.path, twin.path)))
    folder.update(refined={"run": twin.path.name, "time_step": step, "values": values})
    for row in values:
        print(line(row))
