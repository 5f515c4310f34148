"""Command `assess`: judge a recording's safety and ergonomics and print the verdict."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from hric_assessment.contact.area import check_area
from hric_assessment.contact.classes import BY_DURATION, INTERPRETATIONS
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.mass import LARGEST, ROBOT_MASSES
from hric_assessment.ergonomics.scoring import methods
from hric_assessment.separation import stopping
from hric_assessment.tables import LIMIT_TABLES
from hric_assessment.verdict import AssessmentChoices, Verdict, assess, opened
from hric_assessment.verdict.choices import BrakingChoice
from hric_assessment.verdict.comparing import compared
from hric_assessment.verdict.conclusions import CONTACT, GROUPS, QUESTIONS
from hric_assessment.verdict.moment import picture
from hric_bags import files
from hric_bags.arguments import run_arguments
from hric_core.command import Argument, Command, perform
from hric_core.errors import NOT_GOOD, NOT_KNOWN, HricError, check_known

FILE = "verdict.json"
SEVERITY = (0, NOT_KNOWN, NOT_GOOD)
"""Exit codes of the command, from the best to the worst outcome."""
AREA_OPTION = "--contact-area"


class AssessCommand(Command):
    """Assess safety and ergonomics of a run for the person in it.

    Contacts, separation and posture are compared with published tables. The results are estimates of a model. Needs no
    ROS master.
    """

    epilog = (
        "exit codes: 0 all questions that count are within limits (warnings included); 3 one is above limits; 4 none "
        "is above limits, but one is not known; 2 a mistake in the command line; 1 the assessment failed."
    )

    def arguments(self) -> list[Argument]:
        """Return the arguments of the command line."""
        return [
            *run_arguments("a bag, or a c3d file with markers of a body (Plug-in Gait)", "RUN|BAG|C3D"),
            *_choices_arguments(),
            Argument(
                "--only",
                action="append",
                type=_questions,
                default=[],
                metavar="QUESTION[,QUESTION]",
                help=f"questions that count for outcome and exit code: {', '.join(QUESTIONS)}; default: contact, "
                "distance and posture, and a lift above its limit",
            ),
            Argument("--all", action="store_true", help="print all findings with values, figures and assumptions"),
            Argument("--picture", type=Path, metavar="SVG", help="draw arm and person at the worst moment"),
            Argument(
                "--compare",
                nargs="+",
                default=[],
                metavar="RUN",
                help="further recordings, whose findings are printed side by side with those of the first",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Assess a recording and return the exit code of its outcome."""
        if (shown := arguments.picture) is not None and (shown.suffix != ".svg" or not shown.parent.is_dir()):
            raise HricError(f"--picture is {shown}; valid: a file name .svg in an existing folder")
        limits = arguments.limits if arguments.limits in LIMIT_TABLES else Path(arguments.limits).expanduser()
        stops = None if arguments.stop is None else stopping.load(arguments.stop)
        if arguments.contact_area is not None:
            check_area(arguments.contact_area, name=AREA_OPTION)
        versions = {key: version for key in methods() if (version := getattr(arguments, f"{key}_table", ""))}
        choices = AssessmentChoices(
            Limits.named(limits),
            BrakingChoice(stops),
            arguments.contact_area,
            arguments.robot_mass,
            versions,
            interpretation=arguments.contact_class,
        )
        verdicts = [_assessed(name, arguments.runs, choices) for name in (arguments.run, *arguments.compare)]
        only = [question for part in arguments.only for question in part]
        if arguments.compare:
            print(compared(verdicts, only))
        else:
            print(verdicts[0].render(only, full=arguments.all), end="")
        if arguments.picture is not None:
            _draw(verdicts[0], arguments.picture)
        return max((verdict.exit_code(only) for verdict in verdicts), key=SEVERITY.index)


def main(words: Sequence[str]) -> int:
    """Run `hric assess` with these command line words from Python, and return its exit code.

    Raises:
        HricError: a mistake in the words, or a recording that cannot be read.
    """
    return perform(["assess", *words])


def _assessed(name: str, root: Path, choices: AssessmentChoices) -> Verdict:
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
        raise HricError(
            f"the picture {path.name} cannot be drawn: no finding has a time at which the person's position is known"
        )
    files.write_text(path, picture(verdict.moment))


def _questions(text: str) -> list[str]:
    """Return the questions of the option --only as a list."""
    check_known("question", names := text.split(","), QUESTIONS, "--only")
    return names


def _choices_arguments() -> list[Argument]:
    """Return the command line options that set `AssessmentChoices`."""
    return [
        Argument(
            "--limits",
            default=LIMIT_TABLES[0],
            metavar="FILE|bgia2011",
            help=f"contact limits: {', '.join(LIMIT_TABLES)} (default: {LIMIT_TABLES[0]}), or a YAML file of your own",
        ),
        Argument(
            "--contact-class",
            choices=INTERPRETATIONS,
            default=BY_DURATION,
            help="interpretation of clamped contacts: by_duration, transient limits for the first half second of every "
            "contact (default); by_clamping, quasi-static limits from the begin if the body part is clamped",
        ),
        Argument(
            "--stop",
            type=Path,
            metavar="FILE",
            help="YAML file with stopping times and distances of the arm by speed and load, from your measurements or "
            "from hric measure_stops (simulation); default: an assumption, which is printed",
        ),
        Argument(
            AREA_OPTION,
            type=float,
            metavar="M2",
            help="contact area, the smaller of the robot's and the body's [m^2] (1 cm^2 is 1e-4); without it or "
            "human.contact_area in the experiment, no contact is within limits, since its pressure is not known",
        ),
        Argument(
            "--robot-mass",
            choices=ROBOT_MASSES,
            default=LARGEST,
            help="mass of the robot by which the speed of a contact is judged: reflected, with rotors and free joints; "
            "standard, M/2 + m_L; locked, with locked joints; or the largest of the three (default: %(default)s)",
        ),
        *(
            Argument(
                f"--{key}-table",
                choices=method.versions,
                default=method.versions[0],
                help=f"version of {method.table().title}'s table A",
            )
            for key, method in methods().items()
            if len(method.versions) > 1
        ),
    ]
