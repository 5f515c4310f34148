"""Text report of a study: a line for each run, and tables of their comparisons."""

from collections.abc import Sequence

from hric_analysis import stability
from hric_bags import text as text_table
from hric_sweep.records import PlainData
from hric_sweep.study import tables

PEOPLE = {
    "human_joint_difference_max": "human joint [rad]",
    "human_force_difference_max": "grip force [N]",
}
"""Table headings of the largest differences that only runs with a human have."""


def render(result: PlainData) -> str:
    """Return the report of a study, for the terminal and summary.txt; `result`: content of its metrics.json."""
    parts = [f"{result['study']}" + (f", {' '.join(result['arguments'])}" if result["arguments"] else "")]
    for name, form in result["forms"].items():
        lines = [f"{name}: {form['experiment']} {' '.join(form['changes'])}"]
        lines += [_run_line(run, values) for run, values in form["runs"].items()]
        if "start_pose_difference_max" in form:
            lines.append(
                f"  link frames at the start agree within {form['start_pose_difference_max']:.1e} (positions in m, "
                "entries "
                "of rotation matrices)"
            )
        lines += tables.lines(form["runs"], "tracking", "marker tracking", tables.TRACKING_COLUMNS)
        lines += tables.lines(form["runs"], "human", "human (model estimate)", tables.HUMAN_COLUMNS)
        parts.append("\n".join([*lines, "", *_differences(form["compared"])]))
    return "\n\n".join(parts) + "\n"


def _run_line(name: str, run: PlainData) -> str:
    law = run["law_times"]
    rising = "time strictly rises" if law["strictly_rising"] else f"time went BACK {law['backward_steps']} times"
    unstable = ", UNSTABLE" * (run["stability"] == stability.UNSTABLE)
    factor = f"{run['real_time_factor']:.2f} times real time"
    return f"  {name}: {law['calls']} calls of the control law, {rising}{unstable}; {factor} ({run['run']})"


def _differences(pairs: Sequence[PlainData]) -> list[str]:
    people = [key for key in PEOPLE if any(pair[key] is not None for pair in pairs)]
    forces = any(pair["force_bound"] is not None for pair in pairs)
    head = [
        "difference of joint positions [rad]",
        "largest",
        "rms",
        "steady",
        *(PEOPLE[key] for key in people),
        "limit",
    ]
    cells = [[*head, *(["limit [N]"] if forces else []), ""]]
    for pair in pairs:
        verdict = {None: "reported", True: "within bounds", False: "OUT OF BOUNDS"}[pair["passed"]]
        keys = ("peak_difference_max", "rms_difference_max", "steady_difference_max", *people)
        bounds = [_small(pair["at_most"]), *([_small(pair["force_bound"])] if forces else [])]
        cells.append([" - ".join(pair["runs"]), *(_small(pair[key], ".2e") for key in keys), *bounds, verdict])
    return text_table.rows(cells)


def _small(value: float | None, digits: str = ".1e") -> str:
    return "-" if value is None else f"{value:{digits}}"
