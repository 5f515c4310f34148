"""Command `assess`: judge a recording's safety and ergonomics and print the verdict."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from hric_assessment.contact.area import check_area
from hric_assessment.verdict import AssessmentChoices, Verdict, assess, opened
from hric_assessment.verdict.choices import AREA_OPTION, choice_arguments, chosen
from hric_assessment.verdict.comparing import compared
from hric_assessment.verdict.conclusions import CONTACT, GROUPS, QUESTIONS
from hric_assessment.verdict.inputs import FILE as FILE
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.moment import picture
from hric_bags import files, run_notes
from hric_bags.arguments import run_arguments
from hric_core.command import Argument, Command, perform
from hric_core.errors import NOT_GOOD, NOT_KNOWN, HricError, check_known

SEVERITY = (0, NOT_KNOWN, NOT_GOOD)
"""Exit codes of the command, from the best to the worst outcome."""


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
        """Return the command-line arguments."""
        return [
            *run_arguments("a bag, or a trial with markers of people (see hric trial)", "RUN|BAG|TRIAL"),
            *choice_arguments(),
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
        choices = chosen(arguments)
        sources = [opened(name, arguments.runs) for name in (arguments.run, *arguments.compare)]
        verdicts = [_assessed(source, choices) for source in sources]
        only = [question for part in arguments.only for question in part]
        if arguments.compare:
            print(compared(verdicts, only))
        else:
            print(verdicts[0].render(only, full=arguments.all), end="")
            for note in run_notes.read(sources[0].folder) if sources[0].kind == "run" else ():
                print(f"note {note}")
        for source, verdict in zip(sources, verdicts, strict=True):  # after the text: a folder may be read-only
            files.write_json(source.verdict_file, verdict.to_dict())
        if arguments.picture is not None:
            _draw(verdicts[0], arguments.picture)
        return max((verdict.exit_code(only) for verdict in verdicts), key=SEVERITY.index)


def main(words: Sequence[str]) -> int:
    """Run `hric assess` with these command line words from Python, and return its exit code.

    Raises:
        HricError: a mistake in the words, or a recording that cannot be read.
    """
    return perform(["assess", *words])


def _assessed(source: AssessmentInput, choices: AssessmentChoices) -> Verdict:
    """Return the verdict of a recording, after a check of the contact area."""
    verdict = assess(source, choices)
    if choices.contact_area is not None:
        regions = {region for item in verdict.findings if item.group == GROUPS[CONTACT] for region in item.regions}
        check_area(choices.contact_area, regions, AREA_OPTION)
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
