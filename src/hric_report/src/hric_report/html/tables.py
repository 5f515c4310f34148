"""Tables of a page, as plain cells."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hric_analysis.recordings import Event, Recordings
from hric_report import sections
from hric_report.html.table import Table, number
from hric_report.text import setpoint_cells

SHOWN_EVENTS = 500
"""Maximum number of listed events; the rest is only counted. Project default, unconfirmed."""


def blows_table(contacts: Sequence[Mapping[str, Any]]) -> Table:
    """Compare impacts on the human with the closed form; contacts: those of `human` in metrics.json."""
    head = (
        "human",
        "robot",
        "at [s]",
        "speed [m/s]",
        "robot [kg]",
        "human [kg]",
        "spring [N/mm]",
        "first peak [N]",
        "v sqrt(mu k) [N]",
        "ratio",
        "lasts [s]",
        "half sine [s]",
        "impulse [N s]",
        "2 mu v [N s]",
    )
    rows = [
        (
            ", ".join(one["regions"]) or one["link"],
            one["other"],
            f"{one['begin']:.3f}",
            f"{form['speed']:.3f}",
            f"{form['robot_mass']:.2f}",
            f"{form['human_mass']:.2f}",
            f"{1e-3 * form['stiffness']:.0f}",
            f"{form['measured_peak']:.1f}",
            f"{form['peak']:.1f}",
            f"{form['ratio']:.3f}",
            f"{one['duration']:.3f}",
            f"{form['duration']:.3f}",
            f"{one['impulse']:.2f}",
            f"{form['impulse']:.2f}",
        )
        for one in contacts
        if (form := one["transient"])
    ]
    note = (
        "Reflected masses where they met, the robot's with its rotors. The closed form has no other force than the "
        "spring's: a slow touch of a robot that pushes exceeds it."
    )
    return Table("Blows", head, tuple(rows), note, section=sections.HUMAN)


def flat(tree: Any, prefix: str = "") -> list[tuple[str, str]]:
    """Return the leaves of a tree of plain values with dotted keys; a list of plain values is one leaf."""
    if isinstance(tree, Mapping):
        return [leaf for key, value in tree.items() for leaf in flat(value, f"{prefix}.{key}" if prefix else str(key))]
    if isinstance(tree, Sequence) and not isinstance(tree, str) and any(isinstance(item, Mapping) for item in tree):
        return [leaf for k, value in enumerate(tree) for leaf in flat(value, f"{prefix}[{k}]")]
    if isinstance(tree, Sequence) and not isinstance(tree, str):
        return [(prefix, ", ".join(number(item, 6) for item in tree) or "-")]
    return [(prefix, number(tree, 6))]


def overview(run: Mapping[str, Any], metrics: Mapping[str, Any]) -> Table:
    """Return the table of the run's experiment, status, robot, times and revision."""
    robot = (run.get("definition") or {}).get("robot") or {}
    log = metrics["control_log"]
    revision = run.get("revision") or {}
    rows = [
        ("experiment", f"{run.get('experiment', '')}: {run.get('description', '')}"),
        ("status", f"{run.get('status', '')} ({run.get('mode', '')})"),
        (
            "stability",
            "; ".join([metrics["stability"]["verdict"] or "not judged: too short", *metrics["stability"]["reasons"]]),
        ),
        ("arguments", " ".join(run.get("arguments") or []) or "none"),
        ("seed", number(run.get("seed", 0))),
        ("robot", " ".join(str(robot[key]) for key in ("hw", "plant_type") if robot.get(key)) or "-"),
        ("controllers", ", ".join((run.get("definition") or {}).get("controllers") or []) or "-"),
        ("started, finished", f"{run.get('started') or '-'}, {run.get('finished') or '-'}"),
        (
            "robot time",
            f"{log['duration']:.3f} s, {log['cycles']} cycles, {number(run.get('real_time_factor'))} times real time",
        ),
        ("cycles missing, repeated", f"{log['missing_cycles']}, {log['repeated_cycles']}"),
        ("revision", f"{str(revision.get('commit') or '-')[:12]}{' (changed since)' if revision.get('dirty') else ''}"),
        ("hash of the states", str(metrics.get("state_sha256") or "-")[:16]),
    ]
    rows += [(key, str(run[key])) for key in ("error", "subject", "notes") if run.get(key)]
    if run.get("arm_error"):
        rows.append(("error of the arm at the end", str(run["arm_error"])))
    return Table("What ran", ("what", "value"), tuple(rows), section=sections.MADE)


def move_table(move: Mapping[str, Any]) -> Table:
    """Return the table of one setpoint; move: entry of `setpoints` in metrics.json."""
    columns, rows = setpoint_cells(move)
    head = tuple(f"{name} [{unit}]" if unit else name for name, unit in columns)
    title = f"Setpoint at {move['time']:.3f} s through {move['controller']}"
    return Table(title, head, tuple(map(tuple, rows)), section=sections.MOTION)


def limits_table(joints: Mapping[str, Any], counted: bool) -> Table:
    """Return the table of the peak load and the limited cycles of each joint.

    Args:
        joints: `joints` of metrics.json.
        counted: True if the robot published the counts of limited cycles.
    """
    peaks = (("velocity", "|dq| max [rad/s]"), ("effort", "|torque| max [N m]"), ("rotatum", "rotatum max [N m/s]"))
    kinds = ("position", "velocity", "effort", "effort_rate")
    head = ["joint"]
    for _, title in peaks:
        head += [title, "of limit"]
    rows = []
    for name, joint in joints.items():
        row = [name]
        for key, _ in peaks:
            ratio = joint.get(f"{key}_ratio")
            row += [number(joint.get(f"{key}_peak")), "-" if ratio is None else f"{100 * ratio:.0f} %"]
        counts = joint.get("limited_cycles") or {}
        rows.append((*row, *(number(counts.get(kind)) for kind in kinds)))
    note = "" if counted else "The robot published no counts of the cycles in which a limit acted."
    return _known("Joints and their limits", [*head, *(f"cycles limited: {kind}" for kind in kinds)], rows, note)


def _known(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> Table:
    """Return a table without the columns that have no known value."""
    kept = [k for k in range(len(head)) if any(row[k] != "-" for row in rows)]
    cells = tuple(tuple(row[k] for k in kept) for row in rows)
    return Table(title, tuple(head[k] for k in kept), cells, note, section=sections.LIMITS)


def tree_table(title: str, tree: Any, *, folded: bool = False, section: str = sections.MADE) -> Table:
    """Return a table of the leaves of a tree of values, each with its dotted key."""
    return Table(title, ("what", "value"), tuple(flat(tree)), folded=folded, section=section)


def topics_table(metrics: Mapping[str, Any]) -> Table:
    """Return the table of messages per topic; the rate is the count divided by the duration of the control log."""
    duration = metrics["control_log"]["duration"]
    rows = [
        (topic, str(count), number(count / duration, 3) if duration > 0 else "-")
        for topic, count in metrics.get("topics", {}).items()
    ]
    return Table(
        "Topics in the bag", ("topic", "messages", "per second"), tuple(rows), folded=True, section=sections.MADE
    )


def sync_tables(found: Recordings) -> list[Table]:
    """Return the tables of validity and age of each source of the synchronisers, and of their last status."""
    tables = []
    for topic, samples in found.samples.items():
        layout = found.layouts.get(topic + "_layout") or next(iter(found.layouts.values()), None)
        sources = list(dict.fromkeys(map(str, layout.sources))) if layout is not None else []
        width = samples[0][0].size
        usable = [(age, valid) for age, valid in samples if age.size == valid.size == width]
        ages, valid = (np.array(part) for part in zip(*usable, strict=True))
        names = sources if len(sources) == width else [f"source {k}" for k in range(width)]
        policy = f", {layout.policy}, {layout.reference or f'{layout.rate:g} Hz'}" if layout is not None else ""
        rows = tuple(_source(name, ages[:, k].astype(float), valid[:, k]) for k, name in enumerate(names))
        head = ("source", "valid", "age, median [ms]", "age, 99 % [ms]", "age, largest [ms]")
        title = f"Synchronised on {topic}: {len(samples)} samples{policy}"
        tables.append(Table(title, head, rows, section=sections.SYNC))
    return tables + [_status_table(topic, status) for topic, status in found.statuses.items()]


def _source(name: str, age: Any, valid: Any) -> tuple[str, ...]:
    usable = np.abs(age[valid & np.isfinite(age)])
    ages = (np.median(usable), np.quantile(usable, 0.99), usable.max()) if usable.size else (None,) * 3
    cells = (number(None if value is None else 1e3 * value, 3) for value in ages)
    return (name, f"{100.0 * float(valid.mean()):.2f} %", *cells)


def _status_table(topic: str, status: Any) -> Table:
    head = ("source", "samples", "rate [Hz]", "refused", "late", "skew, mean [ms]", "skew, largest [ms]", "at the end")
    rows = tuple(
        (
            str(source),
            str(int(status.samples[k])),
            number(float(status.rate[k])),
            str(int(status.refused[k])),
            str(int(status.late[k])),
            number(1e3 * float(status.skew_mean[k]), 3),
            number(1e3 * float(status.skew_max[k]), 3),
            status.reasons[k] or "good",
        )
        for k, source in enumerate(status.sources)
    )
    note = (
        f"{status.sent} samples went out, {status.incomplete} of them incomplete, {status.dropped} instants left out."
    )
    return Table(f"State of {topic} at the end", head, rows, note, section=sections.SYNC)


def events_table(events: Sequence[Event]) -> Table:
    """Return the table of the first SHOWN_EVENTS events in the order of time."""
    shown = list(events)[:SHOWN_EVENTS]
    rows = tuple((f"{event.time:.3f}", event.kind, event.source, event.text) for event in shown)
    note = (
        "A click on a line shows that moment."
        if len(events) <= SHOWN_EVENTS
        else f"The first {SHOWN_EVENTS} of {len(events)}."
    )
    times = tuple(event.time for event in shown)
    return Table("Events", ("time [s]", "what", "of", "text"), rows, note, times=times, section=sections.LIMITS)


def sources_table(sources: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the table of samples sent, recorded and lost by source; sources: `sources` of metrics.json."""
    head = ("source", "counted in", "sent", "recorded", "lost", "twice", "stamps off, 99 % [ms]", "largest [ms]")
    rows = []
    for topic, one in sources.items():
        counts = (number(one.get(key), 12) for key in ("sent", "recorded", "lost", "twice"))
        late = one.get("stamps") or {}
        stamps = (number(1e3 * late[key], 3) if key in late else "-" for key in ("p99", "largest"))
        rows.append((topic, one["counts"], *counts, *stamps))
    note = "Counted by the sources' own numbers. Stamps are compared with the time codes of emulated devices."
    return Table("Sent and recorded", head, tuple(rows), note, section=sections.SYNC)


def skew_table(streams: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the table of the time skew of synchronised values; streams: `sync` of metrics.json."""
    head = ("stream", "source", "valid", "skew, median [ms]", "99 % [ms]", "largest [ms]", "by")
    rows = []
    for topic, stream in streams.items():
        for source, one in stream["sources"].items():
            skew = one["skew"] or {}
            times = (number(1e3 * skew[key], 3) if key in skew else "-" for key in ("median", "p99", "largest"))
            valid = "-" if one["valid"] is None else f"{100 * one['valid']:.2f} %"
            rows.append((topic, source, valid, *times, one["by"] or "not known"))
    return Table("Skew of the synchronised values", head, tuple(rows), section=sections.SYNC)
