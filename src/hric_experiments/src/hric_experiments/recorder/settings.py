"""Parameters of the recorder node: notes on the run, topics, and start, split and end of a recording."""

import re
from dataclasses import dataclass

from hric_core.parameters import Settings, choice, listing, number, text

SUBJECT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
"""Pattern of a subject's code (pseudonym), so that run folders contain no names of persons; project default,
unconfirmed."""
LONGEST_NOTE = 2000
"""Maximum length of the notes [characters]; project default, unconfirmed."""
MIN_FREE = 1024.0
"""Free disk space below which a recording is ended [MB], so that the recorder's buffer and the report still fit."""
NONE = ("", "none")
"""Values of a parameter that mean "not set"."""
NOW, ON_TRIGGER, ON_REQUEST = "now", "on_trigger", "on_request"


def _code(text: str) -> str:
    code = text.strip()
    if code in NONE:
        return ""
    if not SUBJECT.fullmatch(code):
        raise ValueError
    return code


def _short(notes: str) -> str:
    note = notes.strip()
    if len(note) > LONGEST_NOTE:
        raise ValueError
    return "" if note in NONE else note


@dataclass(frozen=True)
class RecorderSettings(Settings):
    """Parameters of the recorder node."""

    experiment: str = text(
        "", default_text="none", text="experiment that is recorded; none: the run folders are named bringup"
    )
    overrides: str = text(
        "", figures=True, text="overrides of the experiment, separated by spaces; values with spaces in quotes"
    )
    topics: tuple[str, ...] = listing(
        text(empty=False),
        default=(),
        text="topics to record; empty: all, including topics that appear later (checked twice a second)",
    )
    exclude: str = text("", text="regular expression for the complete names of topics that are not recorded")
    start: str = choice(
        NOW,
        ON_TRIGGER,
        ON_REQUEST,
        text="start of a recording. now: with the node; on_trigger: at each message on `hric/experiment/trigger`; "
        "on_request: only by the service",
    )
    subject: str = text(
        "",
        valid="a code of at most 32 letters, digits, - and _, for example P07; recorded data must not contain names of "
        "persons",
        figures=True,
        made=_code,
        default_text="none",
        text="code (pseudonym) of the subject for `run.yaml`: at most 32 letters, digits, - and _",
    )
    notes: str = text(
        "",
        valid=f"at most {LONGEST_NOTE} characters; put longer notes into a file in the run folder",
        figures=True,
        made=_short,
        default_text="none",
        text=f"notes for `run.yaml`, at most {LONGEST_NOTE} characters",
    )
    split_size: float = number(
        0.0, minimum=0.0, unit="MB", text="size of the bag at which it is split and the next part begins; 0: never"
    )
    split_duration: float = number(
        0.0, minimum=0.0, unit="s", text="wall time after which the bag is split and the next part begins; 0: never"
    )
    min_free: float = number(
        MIN_FREE,
        minimum=0.0,
        unit="MB",
        text="free disk space below which a recording is not started, or is ended with a complete bag and an error in "
        "the "
        "log and on `/diagnostics`; the buffered messages must still fit",
    )
    runs: str = text("", text="folder of all runs; empty: $HRIC_RUNS, else runs/ of the workspace")
