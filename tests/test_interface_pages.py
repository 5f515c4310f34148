"""Tables in the INTERFACE.md of each package are well-formed, and their types and modules exist.

Tests in tests/integration compare the pages with the running system.
"""

import importlib.util
import re
import sys
from pathlib import Path

import pytest
import roslib.message

sys.path.insert(0, str(Path(__file__).parent))
from interface_pages import COLUMNS, pages, rows
from interface_tables import changed, declared, marks, printed, settings_of

from hric_core import parameters
from hric_core.node import REQUIRED

ROOT = Path(__file__).resolve().parents[1]
IMPORT = re.compile(r"^ *from (\w+(?:\.\w+)*) import ([\w, ]+)$", re.MULTILINE)


@pytest.fixture(params=pages(), ids=lambda page: page.parent.name)
def page(request: pytest.FixtureRequest) -> Path:
    return request.param


def test_the_tables_have_the_agreed_columns_and_names_in_backticks(page: Path) -> None:
    for row in rows(page):
        assert row.name and all(row.cells[column] for column in ("type",) if column in row.cells), (
            f"{page.parent.name}: {row.cells}"
        )
        assert f"`{row.name}`" in page.read_text(), f"{page.parent.name}: {row.name} is not in backticks"
        assert not row.name.startswith("/"), f"{page.parent.name}: {row.name} has a leading slash"
        if row.section == "Topics":
            assert row.cells["direction"] in ("pub", "sub"), (
                f"{page.parent.name}: {row.name} has direction {row.cells['direction']!r}"
            )


def test_the_types_of_topics_and_services_exist(page: Path) -> None:
    for row in rows(page):
        kind = row.cells["type"]
        if row.section == "Topics":
            assert roslib.message.get_message_class(kind) is not None, (
                f"{page.parent.name}: {row.name} has unknown type {kind}"
            )
        if row.section == "Services":
            assert roslib.message.get_service_class(kind) is not None, (
                f"{page.parent.name}: {row.name} has unknown type {kind}"
            )
        if row.section == "Actions":
            assert roslib.message.get_message_class(f"{kind.removesuffix('Action')}Action") is not None, (
                f"{page.parent.name}: {row.name}: {kind}"
            )


def test_a_section_that_is_there_has_rows(page: Path) -> None:
    text = page.read_text()
    for section in COLUMNS:
        if f"\n## {section}\n" in text:
            assert any(row.section == section for row in rows(page)), f"{page.parent.name}: {section} is empty"


def test_the_tables_say_what_the_declarations_say(page: Path) -> None:
    assert changed(page) is None, f"run: python3 tests/interface_tables.py --write   ({page.parent.name})"


def test_each_declared_default_is_valid(page: Path) -> None:
    for settings in (settings for mark in marks(page.read_text()) for _, settings in settings_of(mark)):
        base = settings.defaults()
        for parameter in parameters.declared(settings).values():
            default = base.get(parameter.name, parameter.default)
            if default is not REQUIRED:
                parameter.checked(default, f"{settings.__name__}.{parameter.name}")


def test_declared_parameters_are_printed_over_old_rows_and_added_where_there_is_none() -> None:
    mark = "robot/ hric_control.robot_settings:RobotSettings"
    rows_ = declared(mark)
    page = (
        f"<!-- declared: {mark} -->\n\n| parameter | type |\n|---|---|\n| `robot/x` | by hand |\n| "
        "`robot/control_log` | stale |\n\nend\n"
    )
    wanted = printed(page)
    assert "| `robot/x` | by hand |\n" + rows_["`robot/control_log`"] in wanted and "stale" not in wanted
    assert all(f"\n| {name} |" in wanted for name in rows_) and wanted.endswith("|\n\nend\n")
    assert printed(wanted) == wanted


def test_the_pages_of_the_nodes_say_what_they_offer() -> None:
    names = {row.name for page in pages() for row in rows(page)}
    assert {"joint_states", "control_log", "controller_manager/switch_controller", "sim/reset_simulation"} <= names


def test_what_pages_and_templates_import_is_there() -> None:
    places = ("*.md", "docs/*.md", "src/*/*.md", "src/*/templates/**/*.py")
    files = [file for place in places for file in ROOT.glob(place)]
    imports = {match.groups() for file in files for match in IMPORT.finditer(file.read_text())}
    named = [(module, name.strip()) for module, names in imports for name in names.split(",")]
    assert ("hric_control.controller", "Controller") in named
    for module, name in named:
        package = importlib.import_module(module)  # `from package import module` also imports a module of it
        there = hasattr(package, name) or importlib.util.find_spec(f"{module}.{name}") is not None
        assert there, f"{module} has no {name}"
