"""Part of a dossier about a sweep, from runs.parquet and sweep.yaml."""

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from hric_assessment.contact.limits import Limits
from hric_assessment.verdict.conclusions import CONTACT, DISTANCE, GROUPS
from hric_report.html import verdict as verdict_page
from hric_sweep.dossier.part import AssessmentGap, DossierPart, StatedReply, listed, present
from hric_sweep.outputs import IMPACT, SUPERVISION
from hric_sweep.page import estimate, lists, sample, spread, words
from hric_sweep.page.study import FAILED, RUNS, SETTINGS, RecordedSweep, load

QUESTION_OF = {IMPACT: CONTACT, SUPERVISION: DISTANCE}
"""Question of the verdict to which the outputs of a sweep belong, by group of values."""
RERUN = "hric sweep rerun repeats a run with its verdict, for a dossier of that run"


def part_of(folder: Path) -> DossierPart:
    """Return the part of a dossier about a sweep.

    Raises:
        HricError: the folder has no table of a sweep.
    """
    study = load(folder)
    counted = sample.of(study)
    outputs = study.section.get("outputs") or {}
    by_name = {name: QUESTION_OF.get(str(output["path"]).split(".")[0], "") for name, output in outputs.items()}
    contact = CONTACT in by_name.values()
    made = {key: value for key, value in study.made.items() if key not in ("definition", "experiment")}
    lines = list(filter(None, estimate.lines(study, "given the distributions of the sweep")))
    tables = {
        "varied": replace(words.varied(study), title="Variables and their distributions"),
        "by_value": estimate.by_value(study),
        "quantiles": spread.table(study, counted, spread.spreads(study, counted)),
    }
    return DossierPart(
        folder,
        "sweep",
        {"study": study, "outputs": outputs, "sampler": words.sampler(study), "estimate": lines, **tables},
        ("plain", f"{study.runs} runs, {study.count('failed')} failed"),
        {question: _reply(study, question, by_name, lines) for question in set(by_name.values()) - {""}},
        list(_gaps(study, set(by_name.values()), counted.refused)),
        {GROUPS[CONTACT]} if contact else (),
        (),
        {Limits.named().table.title} if contact else (),
        present(folder, SETTINGS),
        present(folder, RUNS),
        [
            listed("Definition of the sweep", study.definition),
            listed("Experiment of the runs", study.made.get("experiment")),
            listed("Versions and platform", made),
        ],
    )


def _reply(study: RecordedSweep, question: str, by_name: dict[str, str], lines: list[str]) -> StatedReply:
    """Return the reply of a sweep to a question: the estimated probability that a limit is exceeded, if there is one.

    Args:
        study: the sweep.
        question: question of the verdict.
        by_name: question of each output.
        lines: sentences with the probabilities of the outputs.
    """
    names = [name for name, about in by_name.items() if about == question]
    if lines and study.limit is not None and study.limit.output in names:
        return StatedReply("estimated", "plain", "", lines[0], " ".join(lines[1:]))
    return StatedReply("no limit", "plain", "", f"outputs {', '.join(names)}", "the sweep states no limit for them")


def _gaps(study: RecordedSweep, questions: Collection[str], refused: str) -> Iterator[AssessmentGap]:
    """Yield what a sweep leaves open: questions without output or limit, missing runs, and unknown values.

    Args:
        study: the sweep.
        questions: questions of the verdict to which its outputs belong.
        refused: reason why the runs are not drawn from the distributions of the variables; "": they are.
    """
    for question, text in verdict_page.BY_DEFAULT.items():
        if question not in questions:
            yield AssessmentGap(text, "no output of this sweep is about it", RERUN)
    if study.limit is None:
        yield AssessmentGap("probability above a limit", "the sweep states no limit", "its section exceedance")
    if study.planned is not None and study.runs < study.planned:
        left = f"{study.planned - study.runs} of {study.planned} runs"
        yield AssessmentGap(left, "the sweep ended early", "hric sweep --resume")
    if refused:
        yield AssessmentGap("distribution of the outputs", refused, "a sampler that draws from the distributions")
    for reason, count, _ in lists.failures(study):
        yield AssessmentGap(f"{count} of {study.runs} runs", f"failed: {reason}", "")
    for name in study.outputs:
        values = np.asarray(study.columns[name], dtype=float)[study.kinds != FAILED]
        for count, reason in (
            (np.isnan(values).sum(), "the run has no such value"),
            (np.isinf(values).sum(), "infinite: not proven to be within limits"),
        ):
            if count:
                yield AssessmentGap(f"{name} in {count} of {study.runs} runs", reason, RERUN)
