"""Drawing of a run's figures for print, into the run folder."""

from collections.abc import Callable

from hric_analysis import metrics, recordings
from hric_analysis.values import Values, joint_orders
from hric_bags.parts import Bag
from hric_bags.reader import RunRecord
from hric_bags.run_file import RunFile
from hric_bags.run_folder import RunFolder
from hric_report import drawing, figures
from hric_report.thinning import limited


def draw(
    folder: RunFolder, run: RunFile, bag: Bag, record: RunRecord, values: Values, step: Callable[[str], object]
) -> None:
    """Draw the figures of a run into the folder `figures` of its run folder.

    Args:
        folder: run folder.
        run: contents of run.yaml.
        bag: open bag of the run.
        record: control log with setpoints, profiles and reflexes.
        values: metrics of the run.
        step: callback for the name of each step that starts.
    """
    step("reading sensor signals")
    data = figures.FigureData(
        record,
        metrics.moves(record, joint_orders(run)),
        run.get("limits") or {},
        values.tolerances,
        values.person,
        values.safety,
        values.followed,
        recordings.signals(bag, record.robot_time),
    )
    shown = [limited(figure, drawing.POINTS) for figure in figures.of_run(data)]
    del data
    step(f"drawing {len(shown)} figures")
    drawing.draw(folder.path / drawing.FOLDER, shown, _title(run))


def _title(run: RunFile) -> str:
    """Return the title of a run: name of the experiment, and arguments in brackets."""
    arguments = " ".join(run.get("arguments") or [])
    return f"{run.get('experiment', 'run')} ({arguments})" if arguments else str(run.get("experiment", "run"))
