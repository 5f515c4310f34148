"""Command `reproduce`: simulate published experiments and compare the results with the measured values."""

import argparse
import hashlib
import sys
from pathlib import Path

from tqdm import tqdm

from hric_bags import files
from hric_bags import text as text_table
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_measurements.reproduction import dataset, definition, results
from hric_measurements.reproduction.results import Reproduction
from hric_sweep.task import code_version

ALL, TABLE = "all", "reproduction.md"


class ReproduceCommand(Command):
    """Simulate published experiments and compare the results with the measured values.

    Each row has source, number of subjects, measured value with its published spread, and simulated value. Without NAME
    the experiments are listed. Simulated values are estimates of a model. Needs no ROS master.
    """

    epilog = "exit codes: 0 success, also if a simulated value is outside the published spread; 2 mistake in the input"

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument(
                "name",
                nargs="?",
                metavar="NAME",
                complete=lambda: [ALL, *definition.names()],
                help="name of a published experiment, path of a YAML file, or all (default: list the experiments)",
            ),
            Argument(
                "--out",
                type=Path,
                metavar="DIR",
                help=f"folder for one page per experiment and {TABLE}; finished experiments in it are not simulated "
                "again if code and data are the same (default: print the table only)",
            ),
            Argument(
                "--data",
                type=Path,
                metavar="PATH",
                help="data set of the experiment (CSV or HDF5), or a folder of data sets named like the experiments",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Print the list of experiments, or simulate experiments and print and write their results."""
        if arguments.name is None:
            listed = [(name, definition.load(name).title) for name in definition.names()]
            print("\n".join(text_table.rows([("NAME", "published experiment"), *listed])))
            return
        names = definition.names() if arguments.name == ALL else [arguments.name]
        experiments = {Path(name).stem: definition.load(name) for name in names}
        if arguments.data is not None and not any(experiment.data for experiment in experiments.values()):
            raise HricError(f"--data: {arguments.name} needs no data set; valid: without --data")
        code, finished = code_version(), list[Reproduction]()
        for name, experiment in tqdm(experiments.items(), unit=" experiments", disable=not sys.stderr.isatty()):
            finished.append(reproduced(name, experiment, code, arguments))
        print("\n".join(text_table.rows([row[:-1] for row in (results.HEAD, *results.rows(finished))])))
        print(results.counted(finished))
        if arguments.out is not None:
            files.write_text(arguments.out / TABLE, results.markdown(finished))
            print(f"table and pages: {arguments.out}")


def reproduced(
    name: str, experiment: definition.PublishedExperiment, code: str, arguments: argparse.Namespace
) -> Reproduction:
    """Return the results of an experiment, simulated or restored from the folder; write its file and its page there."""
    data: definition.DataSet = {}
    key = hashlib.sha256(code.encode())
    if experiment.data:
        path = None if arguments.data is None else dataset.find(arguments.data, name)
        if path is None:
            return Reproduction(name, experiment, {})
        key.update(path.read_bytes())
        data = dataset.read(path)
        experiment = experiment.with_data(data, str(path))
    if arguments.out is None:
        return results.simulate(name, experiment, data)
    files.make_folder(arguments.out)
    path = arguments.out / f"{name}.json"
    simulated = results.restore(path, key.hexdigest())
    if simulated is None:
        reproduction = results.simulate(name, experiment, data)
        results.store(path, key.hexdigest(), reproduction)
    else:
        reproduction = Reproduction(name, experiment, simulated)
    files.write_text(arguments.out / f"{name}.html", results.page(reproduction))
    return reproduction
