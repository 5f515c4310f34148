"""Types of those entries of verdict.json that a page reads; its schema is in hric_assessment/config."""

from collections.abc import Sequence
from typing import TypedDict

from hric_assessment.typed_json import Content


class FindingEntry(TypedDict):
    """Finding in verdict.json. share: ratio to the limit [1]; window: begin and end, robot time [s]; None: not known.

    side: "right" or "left" side of the person; "": the middle of the body, or not known.
    person: namespace of the person; "": there is one person only.
    """

    group: str
    subject: str
    outcome: str
    reason: str
    share: float | None
    window: tuple[float, float] | None
    regions: Sequence[str]
    side: str
    person: str


class RecordingEntry(TypedDict):
    """Recording that was assessed; kind: "run", "bag" or "c3d"; begin, end: robot time [s]; notes: what is left out."""

    name: str
    kind: str
    begin: float
    end: float
    notes: Sequence[str]


class ScoreEntry(TypedDict):
    """Posture score of one arm over time [s]; side: "left" or "right"."""

    side: str
    time: Sequence[float]
    score: Sequence[int]


class ActivationEntry(TypedDict):
    """Activation of each muscle over time: names, times [s], and activations [1], one row per muscle; None: unknown."""

    name: Sequence[str]
    time: Sequence[float]
    activation: Sequence[Sequence[float | None]]


_Conclusions = TypedDict("_Conclusions", {"answers": Sequence[Content]})  # noqa: UP013 # the word is a key of the file


class VerdictFile(_Conclusions):
    """Contents of verdict.json; findings: the worst first; timelines: posture scores by method, muscle activation."""

    version: int
    disclaimer: str
    outcome: str
    input: RecordingEntry
    findings: Sequence[FindingEntry]
    timelines: Content
    moment: Content | None
    certainty: Sequence[Content]
