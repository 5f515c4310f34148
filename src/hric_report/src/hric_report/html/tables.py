"""Tables of a run's page: overview, setpoints, contacts, synchronisation."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hric_analysis.metrics import SetpointMetrics
from hric_analysis.recordings import Recordings
from hric_assessment.typed_json import Content
from hric_bags import run_notes
from hric_bags.records import contact_record
from hric_bags.records.contact_record import PairForce
from hric_bags.run_file import RunFile
from hric_core.json_values import from_json
from hric_report.html.table import PageTable, number
from hric_report.text import prismatic, setpoint_cells

SHOWN_EVENTS = 500
"""Maximum number of events in the table; further events are only counted. Project default, unconfirmed."""


def flat(tree: Any, prefix: str = "") -> list[tuple[str, str]]:
    """Return all values in nested mappings as (dotted key, text); a list of plain values is one value."""
    if isinstance(tree, Mapping):
        return [leaf for key, value in tree.items() for leaf in flat(value, f"{prefix}.{key}" if prefix else str(key))]
    if isinstance(tree, Sequence) and not isinstance(tree, str) and any(isinstance(item, Mapping) for item in tree):
        return [leaf for k, value in enumerate(tree) for leaf in flat(value, f"{prefix}[{k}]")]
    if isinstance(tree, Sequence) and not isinstance(tree, str):
        return [(prefix, ", ".join(number(item, 6) for item in tree) or "-")]
    return [(prefix, number(tree, 6))]


def overview(run: RunFile, metrics: Content) -> PageTable:
    """Return the overview table of a run: experiment, status, robot, times and revision."""
    robot = (run.get("definition") or {}).get("robot") or {}
    log = metrics["control_log"]
    revision: Mapping[str, object] = run.get("revision") or {}
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
        (
            "revision",
            f"{str(revision.get('commit') or '-')[:12]}{' (with local changes)' if revision.get('dirty') else ''}",
        ),
        ("hash of the states", str(metrics.get("state_sha256") or "-")[:16]),
    ]
    rows += [(key, str(run[key])) for key in ("error", "subject", "notes") if run.get(key)]
    if joints := metrics.get("prismatic"):
        rows.append(("units", prismatic(joints)))
    if run.get("arm_error"):
        rows.append(("arm error at the end", str(run["arm_error"])))
    return PageTable("Overview of the run", ("entry", "value"), tuple(rows))


def notes_table(folder: Path) -> PageTable | None:
    """Return the table of the notes that a user has added to a finished run; None: there are none."""
    notes = run_notes.read(folder)
    rows = tuple(("-" if note.at is None else f"{note.at:.3f}", note.text, note.by, note.written) for note in notes)
    return PageTable("Notes added after the run", ("time [s]", "note", "by", "written"), rows) if rows else None


def setpoint_table(move: Content) -> PageTable:
    """Return the table of one setpoint; `move`: its entry of `setpoints` in metrics.json."""
    columns, rows = setpoint_cells(from_json(SetpointMetrics, move))
    head = tuple(f"{name} [{unit}]" if unit else name for name, unit in columns)
    return PageTable(f"Setpoint at {move['time']:.3f} s through {move['controller']}", head, tuple(map(tuple, rows)))


def known(table: PageTable) -> PageTable:
    """Return a copy of a table without the columns in which no value is known."""
    columns = [k for k in range(len(table.head)) if any(row[k] != "-" for row in table.rows)]
    rows = tuple(tuple(row[k] for k in columns) for row in table.rows)
    return replace(table, head=tuple(table.head[k] for k in columns), rows=rows)


def contact_table(contacts: Sequence[Content]) -> PageTable:
    """Return the table of contact forces; `contacts`: entry of metrics.json."""
    pairs = [from_json(PairForce, pair) for pair in contacts]
    return PageTable(
        "Contact forces", contact_record.HEAD, tuple(contact_record.cells(pairs)), contact_record.note(pairs)
    )


def sync_tables(recorded: Recordings) -> list[PageTable]:
    """Return one table per synchroniser topic: validity and age of the values of each source."""
    tables = []
    for topic, samples in recorded.samples.items():
        layout = recorded.layouts.get(topic + "_layout") or next(iter(recorded.layouts.values()), None)
        sources = list(dict.fromkeys(map(str, layout.sources))) if layout is not None else []
        width = samples[0][0].size
        usable = [(age, valid) for age, valid in samples if age.size == valid.size == width]
        ages, valid = (np.array(part) for part in zip(*usable, strict=True))
        names = sources if len(sources) == width else [f"source {k}" for k in range(width)]
        policy = f", {layout.policy}, {layout.reference or f'{layout.rate:g} Hz'}" if layout is not None else ""
        rows = tuple(_source(name, ages[:, k].astype(float), valid[:, k]) for k, name in enumerate(names))
        head = ("source", "valid", "age, median [ms]", "age, 99 % [ms]", "age, largest [ms]")
        tables.append(PageTable(f"Synchronised on {topic}: {len(samples)} samples{policy}", head, rows))
    return tables


def _source(name: str, age: Any, valid: Any) -> tuple[str, ...]:
    usable = np.abs(age[valid & np.isfinite(age)])
    ages = (np.median(usable), np.quantile(usable, 0.99), usable.max()) if usable.size else (None,) * 3
    cells = (number(None if value is None else 1e3 * value, 3) for value in ages)
    return (name, f"{100.0 * float(valid.mean()):.2f} %", *cells)
