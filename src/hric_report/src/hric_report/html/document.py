"""Frame of all pages: one HTML file with head, section links, style and scripts that makes no network requests."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from hric_report import style
from hric_report.html.tables import escape

ASSETS = Path(__file__).parent / "assets"
THEME = '<button id=theme type=button title="light, dark, or as the system has it">theme: auto</button>'
POLICY = "style-src 'unsafe-inline'; img-src data: blob:"
"""Content security policy of a page without scripts: it may load only what is in the file."""
SCRIPTED = f"script-src 'unsafe-inline'; {POLICY}"
"""Content security policy of a page that runs the scripts in the file."""


def document(
    title: str,
    subtitle: str,
    verdicts: Iterable[tuple[str, str]],
    main: str,
    *,
    foot: str,
    css: Sequence[Path] = (),
    scripts: Sequence[str] = (),
) -> str:
    """Return the HTML of a page.

    Args:
        title: title, plain text.
        subtitle: line below the title, plain text.
        verdicts: short labels next to the title, as (kind, plain text) with kind good, bad or plain.
        main: HTML of the main element.
        foot: HTML of the footer.
        css: additional style sheets of this page.
        scripts: HTML from `script` and `embedded`; empty: the page may not run scripts.
    """
    return Template((ASSETS / "frame.html").read_text()).substitute(
        policy=SCRIPTED if scripts else POLICY,
        title=escape(title),
        subtitle=escape(subtitle),
        verdicts="".join(f'<span class="verdict {kind}">{escape(text)}</span>' for kind, text in verdicts),
        theme=THEME if scripts else "",
        style="".join(path.read_text() for path in (ASSETS / "page.css", *css)) + style.css(),
        main=main,
        foot=foot,
        scripts="\n".join(scripts),
    )


def links(parts: Mapping[str, str]) -> str:
    """Return the HTML of the links to all sections, which are those of `titled`."""
    shown = (f'<a href="#{_anchor(title)}">{escape(title)}</a>' for title in parts)
    return f"<nav>{' '.join(shown)}</nav>"


def titled(parts: Mapping[str, str]) -> str:
    """Return the HTML of all sections; parts: HTML of each section, by title."""
    return "".join(
        f'<section id="{_anchor(title)}"><h2>{escape(title)}</h2>{content}</section>'
        for title, content in parts.items()
    )


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def script(*texts: str) -> str:
    """Return the HTML element that runs these JavaScript texts."""
    return "<script>\n" + "\n".join(texts) + "\n</script>"


def embedded(name: str, content: Any) -> str:
    """Return the HTML element with data for scripts, by its id: a string unchanged, anything else as JSON."""
    if isinstance(content, str):
        return f'<script type="text/plain" id={name}>{content}</script>'
    # Escape "<": a tag in the text would end the element.
    text = json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id={name}>{text}</script>'
