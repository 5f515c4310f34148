"""What a recorder is told: the notes about a run that a person gives, and when recording begins, is split and ends."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hric_control.errors import HricError
from hric_experiments.free_space import MIN_FREE

SUBJECT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
"""A code, so that no name of a person gets into a run folder; our choice."""
LONGEST_NOTE = 2000
"""Our choice [characters]."""
NONE = ("", "none")
"""Say that nothing is given."""
NOW, ON_TRIGGER, ON_REQUEST = "now", "on_trigger", "on_request"
STARTS = (NOW, ON_TRIGGER, ON_REQUEST)


class RecorderSettingError(HricError):
    """A parameter of the recorder that it cannot use."""


@dataclass(frozen=True)
class RecorderSettings:
    """Parameters of the recorder.

    Attributes:
        start: when it begins: now, on_trigger (and again at each further trigger, when the one before was ended), on_request (by its service only).
        subject: code of the person, empty: none.
        notes: free text.
        split_size: size of a part's file [MB]; 0: not split by size.
        split_duration: length of a part [s of wall time]; 0: not split by time.
        min_free: room on the disk below which the recording is ended [MB].
    """

    start: str = NOW
    subject: str = ""
    notes: str = ""
    split_size: float = 0.0
    split_duration: float = 0.0
    min_free: float = MIN_FREE


def read(parameter: Callable[[str, Any], Any]) -> RecorderSettings:
    """Settings from parameters.

    Args:
        parameter: value of a parameter by name, or the default given.

    Raises:
        RecorderSettingError: names the parameter and what is valid.
    """
    start = str(parameter("start", NOW))
    if start not in STARTS:
        raise RecorderSettingError(f"parameter start: {start!r} is not possible; valid: {', '.join(STARTS)}")
    return RecorderSettings(
        start,
        subject(str(parameter("subject", ""))),
        notes(str(parameter("notes", ""))),
        *(_number(name, parameter(name, default)) for name, default in (("split_size", 0.0), ("split_duration", 0.0), ("min_free", MIN_FREE))),
    )


def subject(given: str) -> str:
    """A subject's code; empty: none.

    Raises:
        RecorderSettingError: it is no code.
    """
    code = given.strip()
    if code in NONE:
        return ""
    if not SUBJECT.fullmatch(code):
        valid = "letters, digits, - and _, at most 32 of them, for example P07; names of people stay out of the data"
        raise RecorderSettingError(f"subject {given!r} is no code; valid: {valid}")
    return code


def notes(given: str) -> str:
    """Notes as they stand in run.yaml; empty: none.

    Raises:
        RecorderSettingError: too long.
    """
    text = given.strip()
    if text in NONE:
        return ""
    if len(text) > LONGEST_NOTE:
        raise RecorderSettingError(f"notes of {len(text)} characters are too long; at most {LONGEST_NOTE}, longer ones as a file in the run folder")
    return text


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number) or number < 0.0:
        raise RecorderSettingError(f"parameter {name}: {value!r} is not possible; valid: a number of 0 or more")
    return number
