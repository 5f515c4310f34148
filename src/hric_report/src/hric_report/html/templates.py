"""Templates of all pages, by Jinja2: each page is one HTML file that makes no network requests.

Every text is escaped, and an unknown name in a template is an error. A template ends with `{% include "frame.html" %}`,
which shows its variables `title`, `subtitle`, `verdicts`, `main`, `foot`, and, if it may run scripts, `scripts`.
"""

import re
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from hric_report import style
from hric_report.html.table import PageTable, number

ASSETS = Path(__file__).parent / "assets"
SECTION = re.compile(r'<section id="([^"]*)"><h2>(.*?)</h2>')


def environment(folder: Path = ASSETS, **filters: Any) -> Environment:
    """Return the templates of a folder, with those that all pages share.

    Args:
        folder: folder of templates and assets, which come before shared ones of the same name.
        filters: functions that its templates use as filters.
    """
    made = Environment(
        loader=FileSystemLoader([folder, ASSETS]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    made.filters |= {"links": _links, "number": number, "scaled": _scaled, **filters}
    made.globals |= {"asset": lambda name: Markup(_text(folder, name)), "style": style, "Table": PageTable}
    return made


def _text(folder: Path, name: str) -> str:
    """Return a file of the folder, or else of those that all pages share."""
    return (folder / name if (folder / name).is_file() else ASSETS / name).read_text()


def _links(main: str) -> Markup:
    """Return the links to all sections of a page."""
    shown = (f'<a href="#{name}">{title}</a>' for name, title in SECTION.findall(main))
    return Markup(f"<nav>{' '.join(shown)}</nav>")


def _scaled(value: float, digits: int = 1) -> str:
    """Return a coordinate of a picture."""
    return f"{value:.{digits}f}"
