"""Parameters of a recorder: notes about the run, and start, split and end of the recording."""

import re
from dataclasses import dataclass

from hric_core.parameters import Settings, choice, listing, number, text

SUBJECT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
"""Pattern of the code of a subject, so that run folders have no personal names; project default, unconfirmed."""
LONGEST_NOTE = 2000
"""Maximum length of a note [characters]; project default, unconfirmed."""
MIN_FREE = 1024.0
"""Free disk space below which a recording is ended, so that the recorder's buffer and the report still fit [MB]."""
NONE = ("", "none")
"""Values of a parameter that mean it is not set."""
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
    """Parameters of the recorder."""

    experiment: str = text(
        "", default_text="none", text="experiment that is recorded; none: run folders are called bringup"
    )
    overrides: str = text(
        "", figures=True, text="overrides of the experiment, separated by spaces; values with spaces in quotes"
    )
    topics: tuple[str, ...] = listing(
        text(empty=False),
        default=(),
        text="topics to record; empty: all, also those that appear later (looked for twice a second)",
    )
    exclude: str = text("", text="regular expression of topics not to record, which fits their whole names")
    start: str = choice(
        NOW,
        ON_TRIGGER,
        ON_REQUEST,
        text="when recording begins: now; on_trigger: with `hric/experiment/trigger`, again and again; "
        "on_request: with the service only",
    )
    subject: str = text(
        "",
        valid="a code of letters, digits, - and _, at most 32 of them, for example P07; names of people stay out "
        "of the data",
        figures=True,
        made=_code,
        default_text="none",
        text="code of the person who takes part, for `run.yaml`: letters, digits, - and _, at most 32",
    )
    notes: str = text(
        "",
        valid=f"at most {LONGEST_NOTE} characters, longer ones as a file in the run folder",
        figures=True,
        made=_short,
        default_text="none",
        text=f"notes for `run.yaml`, at most {LONGEST_NOTE} characters",
    )
    split_size: float = number(
        0.0, minimum=0.0, unit="MB", text="size of a part at which the next one begins; 0: never"
    )
    split_duration: float = number(
        0.0, minimum=0.0, unit="s", text="wall time after which the next part begins; 0: never"
    )
    min_free: float = number(
        MIN_FREE,
        minimum=0.0,
        unit="MB",
        text="free space on the disk below which a recording is refused, or ended with a complete bag and an error on "
        "the log and "
        "`/diagnostics`: what still waits in memory must find room",
    )
    runs: str = text("", text="folder of all runs; empty: $HRIC_RUNS, else runs/ of the workspace")
