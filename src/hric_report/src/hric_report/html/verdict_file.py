"""Contents of verdict.json as far as a page reads them; the schema is hric_assessment's config/verdict.schema.json."""

from collections.abc import Sequence
from typing import TypedDict

from hric_assessment.typed_json import Content


class FindingEntry(TypedDict):
    """Finding; share: ratio to the limit [1]; window: begin and end, robot time [s]; None: not known."""

    group: str
    subject: str
    outcome: str
    reason: str
    share: float | None
    window: tuple[float, float] | None
    regions: Sequence[str]


class RecordingEntry(TypedDict):
    """Recording that was judged; kind: run, bag or c3d; begin, end: robot time [s]."""

    name: str
    kind: str
    begin: float
    end: float


class ScoreEntry(TypedDict):
    """Posture score of one arm over time [s]."""

    side: str
    time: Sequence[float]
    score: Sequence[int]


class ActivationEntry(TypedDict):
    """Activation of muscles by name over time [s]; None: not known."""

    name: Sequence[str]
    time: Sequence[float]
    activation: Sequence[Sequence[float | None]]


_Conclusions = TypedDict("_Conclusions", {"answers": Sequence[Content]})  # noqa: UP013 # the word is a key of the file


class VerdictFile(_Conclusions):
    """Contents of verdict.json; findings: from the worst on; timelines: scores by method, and muscle activation."""

    version: int
    disclaimer: str
    outcome: str
    input: RecordingEntry
    findings: Sequence[FindingEntry]
    timelines: Content
    moment: Content | None
