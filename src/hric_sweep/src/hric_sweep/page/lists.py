"""Failures of runs by reason, the command that repeats a run, and the cost of all runs."""

import re
import shlex
from collections import Counter
from collections.abc import Sequence

import numpy as np

from hric_report.html.table import PageTable, number
from hric_sweep.page.study import FAILED, RecordedSweep

WORST = 10
REASONS = 50
"""Maximum number of failure reasons in the table; rarer ones are only counted. Project default, unconfirmed."""
DECIMAL = re.compile(r"[-+]?\d+\.\d+(e[-+]?\d+)?")


def command(study: RecordedSweep) -> str:
    """Return the command that repeats a run, without the run's id; it names the folder without its path."""
    return f"hric sweep rerun {shlex.quote(study.folder.resolve().name)}"


def failures(study: RecordedSweep) -> list[tuple[str, int, int]]:
    """Return (reason of failure, number of runs, table row of the first of them), most frequent first.

    Reasons that differ only in measured numbers are merged; # replaces each number.
    """
    failed = np.flatnonzero(study.kinds == FAILED)
    reasons = [DECIMAL.sub("#", str(study.columns["failure"][row])) for row in failed]
    first = {reason: int(row) for reason, row in zip(reversed(reasons), reversed(failed), strict=True)}
    return [(reason, count, first[reason]) for reason, count in Counter(reasons).most_common()]


def cost(study: RecordedSweep) -> PageTable:
    """Return the table of processor time and wall time of the runs, in total and by machine."""
    hosts = np.array([str(host) for host in study.columns["host"]])
    rows = [_cost(study, "all", np.ones(study.runs, dtype=bool))]
    names = sorted(set(hosts))
    if len(names) > 1:
        rows += [_cost(study, name, hosts == name) for name in names]
    elif names:
        rows[0] = (names[0], *rows[0][1:])
    times = (
        "processor time, total [s]",
        "per run: mean [s]",
        "median [s]",
        "95th percentile [s]",
        "wall time, mean [s]",
    )
    head = ("machine", "runs", *times, "repeated")
    return PageTable(
        "", head, tuple(rows), "The hash of the results does not include these times, as they depend on the machine."
    )


def _cost(study: RecordedSweep, name: str, rows: Sequence[bool] | np.ndarray) -> tuple[str, ...]:
    processor = np.asarray(study.columns["processor"], dtype=float)[rows]
    wall = np.asarray(study.columns["wall"], dtype=float)[rows]
    again = int(np.sum(np.asarray(study.columns["attempt"], dtype=float)[rows] > 1))
    if not len(processor):
        return (name, "0", "-", "-", "-", "-", "-", "-")
    times = (np.nansum(processor), np.nanmean(processor), np.nanmedian(processor), np.nanquantile(processor, 0.95))
    return (name, str(len(processor)), *(number(float(time)) for time in (*times, np.nanmean(wall))), str(again))
