"""Page of a benchmark: one file that needs no network and no script."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hric_bags import files
from hric_report import style
from hric_report.html.document import document, links, titled
from hric_report.html.tables import Table, escape, render
from hric_sweep.benchmark import text
from hric_sweep.benchmark.results import predicted

NAME = "report.html"
STYLE = Path(__file__).parent / "assets" / "benchmark.css"
CHARTS = (
    "In the charts a line goes from the smallest to the largest value of all runs, a dot is the median of a body, a "
    "dashed line a limit."
)
LEFT, WIDTH, ROW = 150, 620, 20
"""Layout of a chart: width of the names, width of the values, height per controller [px]."""


def write(folder: Path, results: Mapping[str, Any]) -> Path:
    """Write the page of the results to a folder and return its path."""
    path = folder / NAME
    files.write_text(path, build(results))
    return path


def build(results: Mapping[str, Any]) -> str:
    """Return the text of the page."""
    part, order = results["part"], [one["name"] for one in results["standings"]]
    parts = {
        "Order": _overview(results),
        **{_spaced(name): _collaboration(results, name, order) for name in results["collaborations"]},
        "How this was made": _made(results),
    }
    return document(
        "Benchmark of collaborations",
        f"{results['description']}: bodies {', '.join(part['bodies'])} of {results['population']['name']}; seeds "
        f"{', '.join(map(str, part['seeds']))}",
        (_prediction(*one) for one in predicted(results)),
        f"<main><article>{links(parts)}<p class=note>{CHARTS}</p>{titled(parts)}</article></main>",
        foot=f"<p class=disclaimer>{escape(results['disclaimer'])}</p>",
        css=[STYLE],
    )


def _prediction(name: str, said: int, found: int) -> tuple[str, str]:
    return "good" if said == found else "bad", f"{name}: predicted {said}, found {found}"


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _overview(results: Mapping[str, Any]) -> str:
    shown = Table("", text.HEAD, tuple(text.rows(results)), note=results["rule"])
    ranks = "".join(_ranks(results, key) for key in ("ergonomics", "task", "robustness"))
    return render(shown) + ranks


def _ranks(results: Mapping[str, Any], category: str) -> str:
    """Return a table of the mean ranks in a category, by collaboration."""
    order = [one["name"] for one in results["standings"]]
    rows = tuple(
        (_spaced(name), *(f"{one['controllers'][who]['ranks'][category]:.2f}" for who in order))
        for name, one in results["collaborations"].items()
    )
    return render(Table(f"Mean rank in {category}", ("collaboration", *order), rows, folded=True))


def _collaboration(results: Mapping[str, Any], name: str, order: Sequence[str]) -> str:
    head, rows = text.by_collaboration(results, name)
    one = results["collaborations"][name]
    charts = "".join(
        f"<figure class=plot><h3>{escape(_label(key, about))}</h3>{_chart(one, key, order)}"
        f"<figcaption>{escape(about['text'])}</figcaption></figure>"
        for key, about in one["scores"].items()
    )
    note = "Medians over all bodies and seeds, smallest and largest value in brackets."
    failures = "".join(
        f"<p class=note>{escape(who)}, {count} times: {escape(why)}</p>"
        for who in order
        for why, count in one["controllers"][who]["failures"].items()
    )
    return render(Table("", head, tuple(rows), note=note)) + failures + charts


def _label(key: str, about: Mapping[str, Any]) -> str:
    category, _, score = key.partition(".")
    return f"{category}: {score}" + (f" [{about['unit']}]" if about["unit"] else "")


def _chart(one: Mapping[str, Any], key: str, order: Sequence[str]) -> str:
    """Return a chart: for each controller the range over all runs as a line, the median of each body as a dot."""
    scores = [one["controllers"][who]["scores"][key] for who in order]
    limit = one["scores"][key]["limit"]
    ends = [value for score in scores for value in (score["lowest"], score["highest"]) if value is not None]
    top = float(max([*ends, *([limit] if limit else []), 0.0]) or 1.0)
    bottom = float(min([*ends, 0.0]))
    height = ROW * len(order) + 22

    def x(value: float) -> float:
        return LEFT + WIDTH * (value - bottom) / (top - bottom)

    parts = []
    for row, (who, score) in enumerate(zip(order, scores, strict=True)):
        y, colour = ROW * row + 12, f"var(--s{row % len(style.ALIKE)})"
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4}" text-anchor="end">{escape(who)}</text>')
        if score["median"] is None:
            parts.append(f'<text x="{LEFT}" y="{y + 4}">no value</text>')
            continue
        low, high = x(score["lowest"]), x(score["highest"])
        parts.append(f'<line x1="{low:.1f}" x2="{high:.1f}" y1="{y}" y2="{y}" stroke="{colour}" stroke-width="3" />')
        for body, value in score["by_body"].items():
            if value is not None:
                dot = f'<circle cx="{x(value):.1f}" cy="{y}" r="4.5" fill="{colour}">'
                parts.append(f"{dot}<title>{escape(who)}, {escape(body)}: {value:.4g}</title></circle>")
    base = height - 18
    if limit is not None:
        at = f'x1="{x(limit):.1f}" x2="{x(limit):.1f}" y1="0" y2="{base}"'
        parts.append(f'<line {at} stroke="var(--limit)" stroke-width="1.5" stroke-dasharray="5 3" />')
    axis = f'<line x1="{LEFT}" x2="{LEFT + WIDTH}" y1="{base}" y2="{base}" stroke="var(--line)" />'
    ticks = "".join(
        f'<text x="{x(value):.1f}" y="{height - 4}" text-anchor="middle">{value:.3g}</text>'
        for value in (bottom, 0.5 * (bottom + top), top)
    )
    return (
        f'<svg class=scores viewBox="0 0 {LEFT + WIDTH + 30} {height}" role="img">{axis}{"".join(parts)}{ticks}</svg>'
    )


def _made(results: Mapping[str, Any]) -> str:
    rows = [("hash of the definition", results["hashes"]["definition"])]
    rows += [("hash of the tables of limits", results["hashes"]["tables"]), ("code", results["hashes"]["code"])]
    rows.append(("bodies", ", ".join(f"{name}: {who}" for name, who in results["part"]["bodies"].items())))
    rows.append(("percentiles", results["population"]["source"]))
    rows.append(("the same within", f"{100.0 * results['tolerance']:g} % of a value"))
    content = render(Table("", ("what", ""), tuple(rows)))
    for name, one in results["controllers"].items():
        words = [(_spaced(where), " ".join(changes)) for where, changes in one["changes"].items()]
        said = one["prediction"]
        note = one["description"] + ("" if said is None else f". Predicted rank {said['rank']}: {said['text']}")
        content += render(Table(f"Controller {name}", ("collaboration", "overrides"), tuple(words), note=note))
    return content
