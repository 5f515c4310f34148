"""The frame of all pages: one file with head, links to its parts, style and scripts, that lets no request out."""

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
"""What a page may load: what is in it. One with scripts may run these, too."""
SCRIPTED = f"script-src 'unsafe-inline'; {POLICY}"


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
    """The text of a page.

    Args:
        title, subtitle: plain text.
        verdicts: short words beside them, as (kind, plain text): good, bad or plain.
        main: HTML, the element of that name.
        foot: HTML of what is to be said last.
        css: of this page alone.
        scripts: HTML, of `script` and `embedded`; none: the page may run none.
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
    """HTML that leads to each part; parts: those of `titled`."""
    shown = (f'<a href="#{_anchor(title)}">{escape(title)}</a>' for title in parts)
    return f"<nav>{' '.join(shown)}</nav>"


def titled(parts: Mapping[str, str]) -> str:
    """HTML of all parts; parts: HTML of each, by title."""
    return "".join(
        f'<section id="{_anchor(title)}"><h2>{escape(title)}</h2>{content}</section>'
        for title, content in parts.items()
    )


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def script(*texts: str) -> str:
    """HTML that runs JavaScript."""
    return "<script>\n" + "\n".join(texts) + "\n</script>"


def embedded(name: str, content: Any) -> str:
    """HTML of what scripts read, by its id: a string as it is, anything else as JSON."""
    if isinstance(content, str):
        return f'<script type="text/plain" id={name}>{content}</script>'
    # Without any tag in it, which would end the element.
    text = json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id={name}>{text}</script>'
