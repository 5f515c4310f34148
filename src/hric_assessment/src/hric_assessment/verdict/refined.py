"""Numerical error of a run's peak forces and smallest distances, from a twin with half the time step.

Let p be the order of convergence, f a value of the run and g that of the twin. By Richardson's extrapolation the error
of f is about |f - g| 2^p/(2^p - 1). The error bar is this times a safety factor, that of the grid convergence index for
two grids (config/tables/verdict.yaml, grid_order and grid_safety).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from hric_assessment.contact.limits import PARTED
from hric_assessment.findings import CONTACT, SEPARATION, Finding
from hric_assessment.tables import verdict_table
from hric_assessment.typed_json import Content, JsonObject

QUANTITIES = {CONTACT: "transient peak [N]", SEPARATION: "smallest distance [m]"}
"""Quantities that are compared, by group of the findings."""
SAME = 1e-9
"""Relative difference up to which a value counts as the one in run.yaml [1]."""


def error_bar(value: float, refined: float) -> float:
    """Return the error bar of a value, from that of a run with half the time step; all in one unit."""
    table = verdict_table()
    ratio = math.pow(2.0, table["grid_order"])
    return table["grid_safety"] * abs(value - refined) * ratio / (ratio - 1.0)


def refinement(findings: Sequence[Finding], twin: Sequence[Finding]) -> list[JsonObject]:
    """Return the values of a run with those of its twin and their error bars, for run.yaml.

    A finding's partner has the same subject and begins at nearly the same time; without one the error is not known
    (None).

    Args:
        findings: findings of the run.
        twin: findings of the run with half the time step.
    """
    rows, partners = [], _compared(twin)
    for subject, quantity, begin, value in _compared(findings):
        same = [row for row in partners if row[:2] == (subject, quantity) and abs(row[2] - begin) <= PARTED]
        refined = min(same, key=lambda row: abs(row[2] - begin))[3] if same else None
        bar = None if refined is None else error_bar(value, refined)
        rows.append({"subject": subject, "quantity": quantity, "value": value, "refined": refined, "bar": bar})
    return rows


def _compared(findings: Sequence[Finding]) -> list[tuple[str, str, float, float]]:
    """Return subject with person, quantity, begin [s] and value of each finding with one of QUANTITIES."""
    found = []
    for item in findings:
        quantity, contact = QUANTITIES.get(item.group, ""), item.group == CONTACT
        if (value := item.values.get(quantity)) is not None:
            subject = item.subject if contact else item.group  # the nearest links may differ, and the window
            begin = item.window[0] if item.window and contact else 0.0
            found.append((f"{item.person} {subject}".strip(), quantity, begin, value))
    return found


def line(row: Content) -> str:
    """Return a line with a row of `refinement` for the terminal."""
    if row["bar"] is None:
        return f"{row['subject']}: {row['quantity']} {row['value']:.4g}, numerical error not known: not in the twin run"
    return f"{row['subject']}: {row['quantity']} {row['value']:.4g} +- {row['bar']:.2g}; half step {row['refined']:.4g}"


def with_bars(findings: Sequence[Finding], run: Content) -> list[Finding]:
    """Return findings with the error bars that run.yaml has of their values; run: contents of run.yaml."""
    refined = run.get("refined")
    return [*findings] if not refined else [_with_bar(item, refined) for item in findings]


def _with_bar(finding: Finding, refined: Content) -> Finding:
    quantity = QUANTITIES.get(finding.group, "")
    value = finding.values.get(quantity)
    rows: Sequence[Mapping[str, object]] = refined.get("values") or ()
    row = next((r for r in rows if r["quantity"] == quantity and _same(r["value"], value)), None)
    if value is None or row is None:
        return finding
    name, unit = quantity.removesuffix("]").split(" [")
    if not isinstance(bar := row["bar"], float):
        note = f"numerical error of the {name}: not known, since the twin run does not have the same contacts"
        return replace(finding, notes=(*finding.notes, note))
    table = verdict_table()
    note = (
        f"numerical error of the {name}: {value:.4g} +- {bar:.2g} {unit}; {row['refined']:.4g} {unit} with a time step "
        f"of {refined['time_step']:g} s (factor {table['grid_safety']:g}, {table.value_mark('grid_safety')})"
    )
    values = {**finding.values, f"{name}, numerical error [{unit}]": bar}
    return replace(finding, values=values, notes=(*finding.notes, note))


def _same(recorded: object, value: float | None) -> bool:
    return isinstance(recorded, float) and value is not None and abs(recorded - value) <= SAME * abs(value)


def relative_bar(finding: Finding) -> float | None:
    """Return the numerical error of a finding's peak force as a share of it [1]; None: not known."""
    peak, bar = (finding.values.get(name) for name in (QUANTITIES[CONTACT], "transient peak, numerical error [N]"))
    return min(bar / peak, 1.0) if peak and bar is not None else None
