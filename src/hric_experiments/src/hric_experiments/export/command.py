"""Command line: export."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from hric_experiments.export import recording
from hric_experiments.export.exporting import FORMATS, Request, export
from hric_experiments.run_folder import runs_root


def main(arguments: Sequence[str]) -> int:
    """Export a bag."""
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments export",
        description="Write a bag in other formats, with units, axes and rates in the files. Needs no ROS master. What is there already is left "
        "alone, so that an interrupted export goes on.",
    )
    parser.add_argument("run", nargs="?", default="latest", metavar="RUN|BAG", help="run folder, its name, latest (default), or a bag")
    parser.add_argument("--format", nargs="+", required=True, metavar="FORMAT", dest="formats", help=f"some of: {', '.join(FORMATS)}")
    parser.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="to which to keep (default: all)")
    parser.add_argument("--output", type=Path, metavar="DIR", help="where to write (default: export/ of the run, or <bag>_export/ beside a bag)")
    parser.add_argument("--load-body", default="", metavar="BODY", help="external_loads: a set-up file that applies the plates' loads to this body")
    parser.add_argument(
        "--surface",
        type=float,
        default=0.0,
        metavar="METRES",
        help="external_loads, c3d: height of the plates' surface over their electrical origin (c3d: else as the run tells)",
    )
    parser.add_argument("--again", action="store_true", help="write also what is there already")
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    given = parser.parse_args(list(arguments))
    request = Request(tuple(dict.fromkeys(given.formats)), tuple(given.topics), given.load_body, given.surface)
    source = recording.find(given.run, runs_root(given.runs))
    result = export(source, request, given.output, again=given.again, progress=not given.quiet and sys.stderr.isatty())
    if result.reading:
        print(f"read in {result.reading:.1f} s")
    for kind, paths in result.files.items():
        took = f"{result.seconds[kind]:.1f} s" if kind in result.seconds else "there already"
        print(f"{kind:<14}  {took:>13}  {len(paths)} files, {sum(path.stat().st_size for path in paths) / 1e6:.1f} MB")
    for note in result.notes:
        print(note)
    print(f"export: {(given.output or source.output).absolute()}")
    for kind, reason in result.failures.items():
        print(f"export: {kind} was not written: {reason}", file=sys.stderr)
    return 1 if result.failures else 0
