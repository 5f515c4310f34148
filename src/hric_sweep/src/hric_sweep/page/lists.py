"""Tables of single runs: the worst ones with the command that repeats them, failures by reason; and what all cost."""

import re
import shlex
from collections import Counter
from collections.abc import Sequence

import numpy as np

from hric_report.html.tables import Table, escape, number
from hric_sweep.page.study import EXCEEDED, FAILED, OUTPUT, VARIABLE, Study
from hric_sweep.page.words import figure

WORST = 10
REASONS = 50
"""Different reasons in the table; more are counted. Project default, unconfirmed."""
DECIMAL = re.compile(r"[-+]?\d+\.\d+(e[-+]?\d+)?")


def command(study: Study) -> str:
    """What repeats a run, without its id; the folder by its name, as the page names none of a machine."""
    return f"hric sweep rerun {shlex.quote(study.folder.resolve().name)}"


def worst(study: Study) -> str:
    """HTML of the worst runs."""
    order, by = study.order_of_worst
    rows = order[:WORST]
    if not len(rows):
        return "<p>No run has come to an end that could be ranked.</p>"
    names = [*study.named(OUTPUT), *study.named(VARIABLE)]
    head = "".join(f"<th class=num>{escape(name)}</th>" for name in ("run", *map(study.label, names)))
    body = []
    for row in rows:
        cells = "".join(f"<td class=num>{escape(_cell(study.columns[name][row]))}</td>" for name in names)
        look = " class=beyond" if study.kinds[row] == EXCEEDED else ""
        body.append(
            f"<tr{look}><td class=num>{study.columns['index'][row]}</td>{cells}<td>{_rerun(study, int(row))}</td></tr>"
        )
    note = f"<p class=note>The {len(rows)} with the {escape(by)}. {_how_again(study)}</p>"
    return (
        f"{note}<div class=wide><table><thead><tr>{head}<th>id</th></tr></thead>"
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def _how_again(study: Study) -> str:
    return f"A run is repeated, with bag and page, by its id: <code>{escape(command(study))} ID</code>"


def _rerun(study: Study, row: int) -> str:
    """A run's id, with its command to copy."""
    name = str(study.columns["id"][row])
    again = f"{command(study)} {name}"
    return f'<code>{name}</code> <button type=button class=copy data-command="{escape(again)}">copy command</button>'


def _cell(value: object) -> str:
    return figure(value.item() if isinstance(value, np.generic) else value)


def failures(study: Study) -> str:
    """HTML of what went wrong, the most frequent first; reasons that differ in measured numbers alone are one."""
    failed = np.flatnonzero(study.kinds == FAILED)
    if not len(failed):
        return f"<p>None of the {study.runs} runs failed.</p>"
    reasons = [DECIMAL.sub("#", str(study.columns["failure"][row])) for row in failed]
    counts = Counter(reasons).most_common()
    first = {reason: int(row) for reason, row in zip(reversed(reasons), reversed(failed), strict=True)}
    body = "".join(
        f"<tr><td class=num>{count}</td><td class=num>{100.0 * count / study.runs:.3g} %</td>"
        f"<td>{escape(reason)}</td><td>{_rerun(study, first[reason])}</td></tr>"
        for reason, count in counts[:REASONS]
    )
    more = f" {len(counts) - REASONS} rarer reasons are not listed." if len(counts) > REASONS else ""
    note = f"{len(failed)} of {study.runs} runs failed; # stands for a number.{more} {_how_again(study)}"
    return (
        f"<p class=note>{note}</p><div class=wide><table><thead><tr><th class=num>runs</th><th class=num>share</th>"
        f"<th>reason</th><th>the first of them</th></tr></thead><tbody>{body}</tbody></table></div>"
    )


def cost(study: Study) -> Table:
    """Processor and wall time of the runs, together and by machine."""
    hosts = np.array([str(host) for host in study.columns["host"]])
    rows = [_cost(study, "all", np.ones(study.runs, dtype=bool))]
    names = sorted(set(hosts))
    if len(names) > 1:
        rows += [_cost(study, name, hosts == name) for name in names]
    elif names:
        rows[0] = (names[0], *rows[0][1:])
    head = (
        "machine",
        "runs",
        "processor [s]",
        "a run, mean [s]",
        "median [s]",
        "95 % [s]",
        "wall, mean [s]",
        "tried again",
    )
    return Table("", head, tuple(rows), "Left out of the hash of the results, as it depends on the machine.")


def _cost(study: Study, name: str, rows: Sequence[bool] | np.ndarray) -> tuple[str, ...]:
    processor = np.asarray(study.columns["processor"], dtype=float)[rows]
    wall = np.asarray(study.columns["wall"], dtype=float)[rows]
    again = int(np.sum(np.asarray(study.columns["attempt"], dtype=float)[rows] > 1))
    if not len(processor):
        return (name, "0", "-", "-", "-", "-", "-", "-")
    spread = (np.nansum(processor), np.nanmean(processor), np.nanmedian(processor), np.nanquantile(processor, 0.95))
    return (name, str(len(processor)), *(number(float(one)) for one in (*spread, np.nanmean(wall))), str(again))
