"""Hooks of mkdocs that add pages made from the sources to the manual, and CONTRIBUTING.md.

The pages are the INTERFACE.md of each package, the docstrings of modules that users import, and the table of network
ports. mkdocs calls the functions of this module by their names (key `hooks` in mkdocs.yml).
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
"""Modules with a page in the manual, and the names to document; empty: all public names of the module."""
COMMENT = re.compile(r"^[ \t]*<!--.*?-->[ \t]*$", re.MULTILINE | re.DOTALL)
"""Pattern of HTML comments, which are instructions for the tests of the manual."""
UNITS = re.compile(r"```.*?```|`[^`\n]*`|\](?=\s?\[)", re.DOTALL)
"""Pattern of code, or of a bracket before another one: "[x, y] [m]" is a quantity with its unit, not a link."""


def on_files(files: "Files", config: "MkDocsConfig") -> "Files":
    """Add the pages made from the sources to the files of the site."""
    from mkdocs.structure.files import File  # installed in the environment of the site only

    for name, text in pages(ROOT):
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Return a page without HTML comments."""
    return COMMENT.sub("", markdown)


def pages(root: Path) -> Iterator[tuple[str, str]]:
    """Yield the path below docs/ and the Markdown text of each page made from the sources."""
    for page in sorted(root.glob("src/*/INTERFACE.md")):
        yield f"reference/{page.parent.name}.md", without_links_of_units(page.read_text())
    for module, members in PYTHON.items():
        chosen = f"    options:\n      members: [{', '.join(members)}]\n" if members else ""
        yield f"reference/python/{module}.md", f"# {module}\n\n::: {module}\n{chosen}"
    yield "reference/wires.md", runpy.run_path(str(root / "src/hric_core/src/hric_core/wires.py"))["page"]()
    yield "contributing.md", (root / "CONTRIBUTING.md").read_text().replace("](docs/", "](")


def without_links_of_units(text: str) -> str:
    r"""Return Markdown in which a bracket before a unit is escaped as "\]", so that it is no link, except in code."""
    return UNITS.sub(lambda found: "\\]" if found[0] == "]" else found[0], text)
