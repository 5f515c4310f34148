"""Command line of `assess`."""

import argparse
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from hric_assessment.contact.area import check_area
from hric_assessment.contact.limits import Limits
from hric_assessment.ergonomics.scoring import methods
from hric_assessment.separation import stopping
from hric_assessment.tables import LIMIT_TABLES
from hric_assessment.verdict.assess import assess
from hric_assessment.verdict.choices import Braking, Choices
from hric_assessment.verdict.comparing import compared
from hric_assessment.verdict.conclusions import CONTACT, GROUPS, QUESTIONS
from hric_assessment.verdict.inputs import opened
from hric_assessment.verdict.moment import picture
from hric_assessment.verdict.result import Verdict
from hric_bags import files
from hric_bags.run_folder import runs_root
from hric_core.errors import MISTAKE, HricError, check_known, refused_by_system

FILE = "verdict.json"
SEVERITY = (0, 4, 1)
"""Exit codes of verdicts, from the best to the worst."""
SOFTWARE = 70
"""Exit code of an error of this program, EX_SOFTWARE of sysexits.h: it must not read as "above limits"."""
AREA_OPTION = "--contact-area"


def run(arguments: Sequence[str]) -> int:
    """Return the exit code of `main`, or SOFTWARE with a message if the program itself fails.

    Raises:
        HricError: as in `main`.
    """
    try:
        return main(arguments)
    except HricError as error:
        error.exit_code = MISTAKE  # for any failure: 1 means "above limits"
        raise
    except OSError as error:
        raise HricError(str(refused_by_system(error))) from error
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        print(
            f"assess: an error of the program, nothing was assessed: {type(error).__name__}: {error}\n"
            f"  in {where.filename}:{where.lineno}; please report it with the recording",
            file=sys.stderr,
        )
        return SOFTWARE


def main(arguments: Sequence[str]) -> int:
    """Assess a recording and return the exit code of its outcome.

    Raises:
        HricError: a mistake in the call, or a recording that cannot be read.
    """
    options = _parser().parse_args(list(arguments))
    if (shown := options.picture) is not None and (shown.suffix != ".svg" or not shown.parent.is_dir()):
        raise HricError(f"--picture {shown} cannot be; valid: a file .svg in a folder that exists")
    root = runs_root(options.runs)
    limits = options.limits if options.limits in LIMIT_TABLES else Path(options.limits).expanduser()
    stops = None if options.stop is None else stopping.load(options.stop)
    if options.contact_area is not None:
        check_area(options.contact_area, name=AREA_OPTION)
    versions = {key: version for key in methods() if (version := getattr(options, f"{key}_table", ""))}
    choices = Choices(Limits.named(limits), Braking(stops), options.contact_area, versions)
    verdicts = [_assessed(name, root, choices) for name in (options.recording, *options.compare)]
    only = [question for part in options.only for question in part]
    if options.compare:
        print(compared(verdicts, only))
    else:
        print(verdicts[0].render(only, full=options.all), end="")
    if options.picture is not None:
        _draw(verdicts[0], options.picture)
    return max((verdict.exit_code(only) for verdict in verdicts), key=SEVERITY.index)


def _assessed(name: str, root: Path, choices: Choices) -> Verdict:
    """Return the verdict of a recording, and write it next to the recording."""
    source = opened(name, root)
    verdict = assess(source, choices)
    if choices.contact_area is not None:
        regions = {region for item in verdict.findings if item.group == GROUPS[CONTACT] for region in item.regions}
        check_area(choices.contact_area, regions, AREA_OPTION)
    files.write_json(source.folder / FILE, verdict.to_dict())
    return verdict


def _draw(verdict: Verdict, path: Path) -> None:
    if verdict.moment is None:
        raise HricError(f"no picture {path.name}: nobody's place is known at a moment that decides")
    files.write_text(path, picture(verdict.moment))


def _questions(text: str) -> list[str]:
    """Return the questions of an option as a list."""
    check_known("question", names := text.split(","), QUESTIONS, "--only")
    return names


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "rosrun hric_assessment assess",
        description="What a run would have meant for the person in it: contacts, separation and posture held against "
        "published tables. Estimates of a model. Needs no ROS master.",
        epilog="exit codes: 0 every question that counts is within limits (warnings too); 1 one is above limits; 4 "
        "none is above, but one is not known; 2 a mistake in the call; 70 an error of the program.",
    )
    parser.add_argument(
        "recording",
        nargs="?",
        default="latest",
        metavar="RUN|BAG|C3D",
        help="run folder, its name, latest (default), a bag, or a c3d file with markers of a body (Plug-in Gait)",
    )
    _add_choices(parser)
    parser.add_argument(
        "--only",
        action="append",
        type=_questions,
        default=[],
        metavar="QUESTION[,QUESTION]",
        help=f"judge these questions alone, with their exit code: {', '.join(QUESTIONS)}; default: contact, distance "
        "and posture, and a lift above its limit",
    )
    parser.add_argument("--all", action="store_true", help="all findings with values and notes, figures, assumptions")
    parser.add_argument("--picture", type=Path, metavar="SVG", help="draw arm and person at the worst moment")
    parser.add_argument(
        "--compare", nargs="+", default=[], metavar="RUN", help="further recordings: the findings of all side by side"
    )
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    return parser


def _add_choices(parser: argparse.ArgumentParser) -> None:
    """Add the options that become `Choices`."""
    parser.add_argument(
        "--limits",
        default=LIMIT_TABLES[0],
        metavar="FILE|bgia2011",
        help=f"limits of contacts: {', '.join(LIMIT_TABLES)} (default: {LIMIT_TABLES[0]}), or a YAML file of your own",
    )
    parser.add_argument(
        "--stop",
        type=Path,
        metavar="FILE",
        help="how the arm stops, by speed and load: a YAML file of your measurements, or of rosrun hric_experiments "
        "measure_stops (a simulation's); default: an assumption, which is printed",
    )
    parser.add_argument(
        AREA_OPTION,
        type=float,
        metavar="M2",
        help="over which contacts act, the smaller of the robot's and the body's [m^2] (1 cm^2 is 1e-4); without it, "
        "or human.contact_area of the experiment, no contact is within limits, since its pressure is not known",
    )
    for key, method in methods().items():
        if len(method.versions) > 1:
            about = f"version of {method.table().title}'s table A"
            parser.add_argument(f"--{key}-table", choices=method.versions, default=method.versions[0], help=about)
