"""Part of a dossier about one run, from run.yaml, metrics.json and verdict.json."""

from collections.abc import Iterator, Mapping
from typing import Any

from hric_assessment.findings import Outcome
from hric_assessment.typed_json import Content
from hric_assessment.verdict.conclusions import Conclusion, Reply
from hric_assessment.verdict.inputs import FILE
from hric_assessment.verdict.moment import Moment, picture
from hric_bags import run_notes
from hric_bags.run_file import RunFile
from hric_bags.run_folder import COMPLETED, RunFolder
from hric_report import html as report_html
from hric_report.html import body_picture, tables
from hric_report.html import verdict as verdict_page
from hric_sweep.dossier.part import AssessmentGap, DossierPart, StatedReply, listed, present

SIDES = ("right", "left")


def part_of(folder: RunFolder) -> DossierPart:
    """Return the part of a dossier about a run; verdict.json and metrics.json are written first if they are missing.

    Raises:
        HricError: the run cannot be read.
    """
    run, metrics = folder.read(), report_html.metrics_of(folder)
    verdict: Any = verdict_page.verdict_of(folder)
    findings = verdict["findings"] if verdict else ()
    return DossierPart(
        folder.path,
        "run",
        {"run": run, "verdict": verdict, "pictures": _pictures(verdict) if verdict else ()},
        verdict_page.label(verdict) if verdict else ("unknown", "not assessed"),
        {item.question: _reply(item) for item in verdict_page.conclusions_of(verdict)} if verdict else {},
        list(_gaps(run, verdict)),
        {finding["group"] for finding in findings},
        {region for finding in findings for region in finding["regions"]},
        {verdict["limits"]["title"]} if verdict else (),
        present(folder.path, "run.yaml", FILE, "metrics.json", "robot.urdf", run_notes.FILE),
        present(folder.path, folder.bag_of(run).name),
        [
            tables.overview(run, metrics),
            *filter(None, [tables.notes_table(folder.path)]),
            listed("Definition of the experiment", run.get("definition") or {}),
            listed("Versions and platform", {key: run.get(key) or {} for key in ("versions", "platform")}),
        ],
    )


def _reply(item: Conclusion) -> StatedReply:
    who = f"{item.person}: " if item.person else ""
    return StatedReply(item.reply, verdict_page.REPLIES[item.reply], item.number, f"{who}{item.subject}", item.reason)


def _pictures(verdict: Content) -> Mapping[str, str]:
    """Return SVG pictures of the worst moment and of the contacts on the body, by caption."""
    scene = verdict["moment"]
    caption = scene and f"Worst moment, {scene['question']}: {scene['subject']}, at {scene['time']:.2f} s"
    pictures = {caption: picture(Moment.of(scene))} if scene else {}
    ratio = f"Contacts; colour: largest ratio to the limit of the region in {verdict['limits']['title']}"
    return {**pictures, ratio: body_picture.picture(verdict["findings"], SIDES)}


def _gaps(run: RunFile, verdict: Content | None) -> Iterator[AssessmentGap]:
    """Yield what the run leaves open: unanswered questions, findings without a decision, and signals not recorded."""
    if run.get("status") != COMPLETED:
        reason = f"the run is {run.get('status') or 'of unknown status'}"
        yield AssessmentGap("the task to its end", reason, "repeat the run")
    if verdict is None:
        yield AssessmentGap("safety and ergonomics", "no person was in the run", "a run with a person")
        return
    undecided = [item for item in verdict["answers"] if item["reply"] in (Reply.UNKNOWN, Reply.NO_LIMIT)]
    for item in undecided:
        reason = "; ".join(filter(None, (f"{item['reply']}: {item['subject']}", item["reason"])))
        yield AssessmentGap(verdict_page.BY_DEFAULT[item["question"]], reason, item["remedy"])
    for index, finding in enumerate(verdict["findings"]):
        if finding["outcome"] == Outcome.NOT_ASSESSABLE and index not in [item["finding"] for item in undecided]:
            yield AssessmentGap(finding["subject"], finding["reason"], finding["remedy"])
    for signal in verdict["missing"]:
        yield AssessmentGap(signal["signal"], f"not recorded; it would give {signal['gives']}", "record it")
