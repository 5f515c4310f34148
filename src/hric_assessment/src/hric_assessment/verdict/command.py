"""Command line: assess."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from hric_assessment.contact.limits import Limits
from hric_assessment.separation import stopping
from hric_assessment.tables import LIMIT_TABLES
from hric_assessment.verdict.assess import assess
from hric_assessment.verdict.choices import Braking, Choices
from hric_assessment.verdict.comparing import compared
from hric_assessment.verdict.given import opened
from hric_assessment.verdict.result import Verdict
from hric_bags import files
from hric_bags.run_folder import runs_root
from hric_control.errors import HricError

FILE = "verdict.json"
SEVERITY = (0, 4, 1)
"""Exit codes of verdicts, from the best to the worst."""


def main(arguments: Sequence[str]) -> int:
    """Assess a recording; returns the exit code of its outcome."""
    given = _parser().parse_args(list(arguments))
    root = runs_root(given.runs)
    limits = given.limits if given.limits in LIMIT_TABLES else Path(given.limits).expanduser()
    stops = None if given.stop is None else stopping.load(given.stop)
    choices = Choices(Limits.named(limits), Braking(stops), given.contact_area)
    verdicts = [_assessed(name, root, choices) for name in (given.recording, *given.compare)]
    if given.compare:
        print(compared(verdicts))
    else:
        print(verdicts[0].render())
    return max((one.exit_code for one in verdicts), key=SEVERITY.index)


def _assessed(name: str, root: Path, choices: Choices) -> Verdict:
    """The verdict, written beside its recording."""
    found = opened(name, root)
    verdict = assess(found, choices)
    try:
        files.write_json(found.folder / FILE, verdict.to_dict())
    except OSError as error:
        raise HricError(f"cannot write {FILE} in {found.folder}: {error.strerror or error}") from error
    return verdict


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "rosrun hric_assessment assess",
        description="What a run would have meant for the person in it: contacts, separation and posture held against "
        "published tables. Estimates of a model. Needs no ROS master.",
        epilog="exit codes: 0 within limits (warnings too); 1 above limits; 4 not assessable; 2 a mistake in the call.",
    )
    parser.add_argument(
        "recording",
        nargs="?",
        default="latest",
        metavar="RUN|BAG|C3D",
        help="run folder, its name, latest (default), a bag, or a c3d file with markers of a body (Plug-in Gait)",
    )
    parser.add_argument(
        "--limits",
        default=LIMIT_TABLES[0],
        metavar="FILE|bgia2011",
        help=f"of contacts: one of {', '.join(LIMIT_TABLES)} (default: {LIMIT_TABLES[0]}), or a YAML file of your own",
    )
    parser.add_argument(
        "--stop",
        type=Path,
        metavar="FILE",
        help="how the arm stops, by speed and load: a YAML file of your measurements, or of rosrun hric_experiments "
        "measure_stops (a simulation's); default: an assumption, which is printed",
    )
    parser.add_argument(
        "--contact-area",
        type=float,
        metavar="M2",
        help="over which contacts act, the smaller of the robot's and the body's [m^2]; without it no contact is "
        "within limits, since its pressure is not known",
    )
    parser.add_argument(
        "--compare", nargs="+", default=[], metavar="RUN", help="further recordings: the findings of all side by side"
    )
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    return parser
