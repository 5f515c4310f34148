"""HTML page of one run."""

from markupsafe import Markup

from hric_analysis import stability
from hric_analysis.recordings import RunEvent
from hric_bags import run_notes
from hric_bags.run_folder import COMPLETED
from hric_report import figures, headline
from hric_report.figures import FigureData
from hric_report.html import human_and_objects, moving, supervisor, verdict
from hric_report.html.page import Page, replay_rate
from hric_report.html.run_data import RunData
from hric_report.html.scene import SceneRobot
from hric_report.html.table import number


def build(data: RunData) -> Page:
    """Return the contents of the page of a run."""
    run, values = data.run, data.values
    notes: list[str] = []
    return Page(
        title=f"{run.get('experiment', 'run')}",
        subtitle=f"{data.folder.path.name}: {run.get('description', '')}",
        verdicts=verdicts(data),
        findings=headline.of_run(run, data.run_metrics, data.verdict),
        figures=figures.of_run(
            FigureData(
                data.record,
                data.moves,
                run.get("limits") or {},
                sorted({float(value) for move in values["setpoints"] for value in move["settling_time_max"]}),
                data.person,
                data.safety,
                data.followed,
                data.recorded.signals,
            )
        ),
        run=data,
        events=events(data),
        robots=robots(data, notes),
        notes=notes,
        verdict=Markup() if data.verdict is None else verdict.part(data.verdict),
        supervisor=supervisor.strip(data.safety),
        name=data.folder.path.name,
    )


def robots(data: RunData, notes: list[str]) -> list[SceneRobot]:
    """Return robot, person and objects of a run for the replay; append remarks on missing ones to `notes`."""
    if not data.description:
        notes.append("There is no replay: the run folder has no robot.urdf.")
        return []
    span = data.record.log.time[-1] - data.record.log.time[0]
    rate = replay_rate(span, moving.width(data) + human_and_objects.width(data))
    return [moving.robot(data, rate, notes), *human_and_objects.human(data, rate), *human_and_objects.objects(data)]


def verdicts(data: RunData) -> list[tuple[str, str]]:
    """Return the labels below the title, as (kind, text): verdict on the person, then status, stability and others."""
    status, values = str(data.run.get("status", "")), data.values
    labels = [] if data.verdict is None else [verdict.label(data.verdict)]
    labels.append(("good" if status == COMPLETED else "bad", status))
    stable = values["stability"]
    if stable["verdict"] is not None:
        labels.append(
            (
                "good" if stable["verdict"] == stability.STABLE else "bad",
                ", ".join([stable["verdict"], *list(stable["joints"])[:1]]),
            )
        )
    if values.get("reflexes"):
        labels.append(("bad", f"reflexes of the arm: {len(values['reflexes'])}"))
    touched = values.get("limits_touched")
    if touched is not None:
        acted = any(touched.values()) or any(joint.get("command_change") for joint in values["joints"].values())
        labels.append(("bad", "limits acted") if acted else ("good", "no limit acted"))
    missing = values["control_log"]["missing_cycles"]
    labels.append(("bad", f"{missing} cycles missing") if missing else ("good", "every cycle recorded"))
    return labels


def events(data: RunData) -> list[RunEvent]:
    """Return all events of a run in the order of time: recorded ones, setpoints, reflexes, supervisor events, notes."""
    listed = list(data.recorded.events)
    listed += [
        RunEvent(s.time, "setpoint", s.controller, ", ".join(number(float(q)) for q in s.positions) + " rad")
        for s in data.record.setpoints
    ]
    listed += [RunEvent(time, "reflex", "arm", ", ".join(names)) for time, names in data.record.reflexes]
    if data.safety is not None:
        listed += [RunEvent(event.time, event.kind, "supervisor", event.text) for event in data.safety.events]
    notes = run_notes.read(data.folder.path)
    listed += [RunEvent(note.at, "note", note.signature, note.text) for note in notes if note.at is not None]
    return sorted(listed, key=lambda event: event.time)
