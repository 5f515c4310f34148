"""Pages of the manual that are made from the sources, and CONTRIBUTING.md.

These are the interface of each package and the docstrings of what users import. mkdocs calls the functions by their
names (hooks in mkdocs.yml).
"""

import re
import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files

ROOT = Path(__file__).parent
PYTHON: dict[str, tuple[str, ...]] = {
    "hric_control.controller": (),
    "hric_control.hardware_interface": (),
    "hric_core.node": (),
    "hric_core.realtime": (),
    "hric_core.parameters": (),
    "franka_hw_interface.interfaces": (),
    "franka_hw_interface.model": (),
    "hric_run.definition.experiment": ("load", "Experiment", "Setpoint", "ExperimentError"),
    "hric_report.headless": ("run", "HeadlessResult"),
    "hric_bags.reader": (),
}
"""Modules that users of the workspace import, and what they take of them; empty: all that is public."""
COMMENT = re.compile(r"^[ \t]*<!--.*?-->[ \t]*$", re.MULTILINE | re.DOTALL)
"""Lines that are for the tests of the manual only."""
UNITS = re.compile(r"```.*?```|`[^`\n]*`|\](?=\s?\[)", re.DOTALL)
"""Code, or the bracket before another one: "[x, y] [m]" is a quantity with its unit, not a link."""


def on_files(files: "Files", config: "MkDocsConfig") -> "Files":
    """Add the pages that are made."""
    from mkdocs.structure.files import File  # in the site's own environment only

    for name, text in pages(ROOT):
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Leave out the comments."""
    return COMMENT.sub("", markdown)


def pages(root: Path) -> Iterator[tuple[str, str]]:
    """Name below docs/ and text of each page that is made."""
    for page in sorted(root.glob("src/*/INTERFACE.md")):
        yield f"reference/{page.parent.name}.md", without_links_of_units(page.read_text())
    for module, members in PYTHON.items():
        chosen = f"    options:\n      members: [{', '.join(members)}]\n" if members else ""
        yield f"reference/python/{module}.md", f"# {module}\n\n::: {module}\n{chosen}"
    yield "reference/wires.md", runpy.run_path(str(root / "src/hric_core/src/hric_core/wires.py"))["page"]()
    yield "contributing.md", (root / "CONTRIBUTING.md").read_text().replace("](docs/", "](")


def without_links_of_units(text: str) -> str:
    r"""Return the text with "\]" where a bracket with a unit follows, outside of code."""
    return UNITS.sub(lambda found: "\\]" if found[0] == "]" else found[0], text)
