"""Tables of a benchmark for a terminal."""

from hric_bags import text as text_table
from hric_sweep.benchmark.results import predicted
from hric_sweep.records import PlainData

HEAD = ("rank", "controller", "not within limits", "ergonomics", "task", "not completed", "spread")


def rows(results: PlainData) -> list[tuple[str, ...]]:
    """Return one table row per controller, with the columns of HEAD: counts of runs, and mean ranks."""
    return [
        (
            str(standing["rank"]),
            standing["name"],
            f"{standing['out_of_limits']} of {standing['runs']}",
            f"{standing['ergonomics']:.2f}",
            f"{standing['task']:.2f}",
            f"{standing['incomplete']} of {standing['runs']}",
            f"{standing['spread']:.2f}",
        )
        for standing in results["standings"]
    ]


def by_collaboration(results: PlainData, name: str) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return header and rows of a collaboration's table: medians of its scores, one column per ranked controller."""
    collaboration, order = results["collaborations"][name], [item["name"] for item in results["standings"]]
    lines = []
    for key, about in collaboration["scores"].items():
        category, _, score = key.partition(".")
        label = f"{score} [{about['unit']}]" if about["unit"] else score
        limit = "" if about["limit"] is None else f"{about['limit']:g}"
        values = (_value(collaboration["controllers"][who]["scores"][key]) for who in order)
        lines.append((category, label, limit, *values))
    for category, label, keys in (
        ("findings", "runs not within limits", ("above", "unknown")),
        ("robustness", "runs not completed", ("incomplete",)),
    ):
        cells = (collaboration["controllers"][who] for who in order)
        lines.append((category, label, "", *(f"{sum(cell[key] for key in keys)} of {cell['runs']}" for cell in cells)))
    return ("category", "score, median", "limit", *order), lines


def _value(score: PlainData) -> str:
    if score["median"] is None:
        return "-"
    return f"{score['median']:.3g} ({score['lowest']:.3g} to {score['highest']:.3g})"


def render(results: PlainData) -> str:
    """Return the results of a benchmark as text for a terminal."""
    part = results["part"]
    lines = [
        f"{results['description']}: {', '.join(part['collaborations'])}; bodies {', '.join(part['bodies'])} of "
        f"{results['population']['name']}; seeds {', '.join(map(str, part['seeds']))}",
        "",
        *text_table.rows([HEAD, *rows(results)]),
        "",
        f"rule: {results['rule']}",
    ]
    for name in results["collaborations"]:
        head, cells = by_collaboration(results, name)
        lines += ["", f"{name}:", *text_table.rows([head, *cells])]
    lines += [
        "",
        *(f"{name}: predicted rank {expected}, actual rank {rank}" for name, expected, rank in predicted(results)),
    ]
    lines += [f"definition {results['hashes']['definition'][:16]}, tables {results['hashes']['tables'][:16]}"]
    return "\n".join([*lines, results["disclaimer"]])
