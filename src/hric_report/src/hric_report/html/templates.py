"""Jinja2 templates of all HTML pages; each page is one file that makes no network requests.

Texts are escaped automatically, and an unknown name in a template is an error. A template ends with
`{% include "frame.html" %}`, which shows its variables `title`, `subtitle`, `verdicts`, `main` and `foot` (empty:
a page of a server, not a file), and `scripts` if the page may run scripts.
"""

import re
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from hric_report import style
from hric_report.html.table import PageTable, number

ASSETS = Path(__file__).parent / "assets"
DARK = re.compile(r":root\[data-theme=dark\] (\{[^}]*\})")
SECTION = re.compile(r'<section id="([^"]*)"><h2>(.*?)</h2>')


def environment(folder: Path = ASSETS, **filters: Any) -> Environment:
    """Return the Jinja2 environment with the templates of a folder and the templates that all pages share.

    Args:
        folder: folder of templates and assets, which take precedence over shared ones with the same name.
        filters: functions that the templates use as filters, by name.
    """
    made = Environment(
        loader=FileSystemLoader([folder, ASSETS]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    made.filters |= {"in_the_dark": _in_the_dark, "links": _links, "number": number, "scaled": _scaled, **filters}
    made.globals |= {"asset": lambda name: Markup(_text(folder, name)), "style": style, "Table": PageTable}
    return made


def _text(folder: Path, name: str) -> str:
    """Return the text of an asset from the folder, or from the shared assets if the folder lacks it."""
    return (folder / name if (folder / name).is_file() else ASSETS / name).read_text()


def _in_the_dark(css: str) -> Markup:
    """Return a copy of the CSS rules of the dark theme for systems that prefer it, which pages without scripts need."""
    rules = "".join(f":root:not([data-theme]) {rule}" for rule in DARK.findall(css))
    return Markup(f"@media (prefers-color-scheme: dark) {{ {rules} }}")


def _links(main: str) -> Markup:
    """Return the navigation bar with links to all sections in the HTML of a page."""
    shown = (f'<a href="#{name}">{title}</a>' for name, title in SECTION.findall(main))
    return Markup(f"<nav>{' '.join(shown)}</nav>")


def _scaled(value: float, digits: int = 1) -> str:
    """Format a coordinate of a picture with a fixed number of decimals."""
    return f"{value:.{digits}f}"
