"""INTERFACE.md of each package: tables that can be read, names and types that exist. The running system is compared in tests/integration."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import roslib.message

sys.path.insert(0, str(Path(__file__).parent))
from interface_pages import COLUMNS, pages, rows


@pytest.fixture(params=pages(), ids=lambda page: page.parent.name)
def page(request: pytest.FixtureRequest) -> Path:
    return request.param


def test_the_tables_have_the_agreed_columns_and_names_in_backticks(page: Path) -> None:
    for row in rows(page):
        assert row.name and all(row.cells[column] for column in ("type",) if column in row.cells), f"{page.parent.name}: {row.cells}"
        assert f"`{row.name}`" in page.read_text(), f"{page.parent.name}: {row.name} is not in backticks"
        assert not row.name.startswith("/"), f"{page.parent.name}: {row.name} has a leading slash"
        if row.section == "Topics":
            assert row.cells["direction"] in ("pub", "sub"), f"{page.parent.name}: {row.name} has direction {row.cells['direction']!r}"


def test_the_types_of_topics_and_services_exist(page: Path) -> None:
    for row in rows(page):
        kind = row.cells["type"]
        if row.section == "Topics":
            assert roslib.message.get_message_class(kind) is not None, f"{page.parent.name}: {row.name} has unknown type {kind}"
        if row.section == "Services":
            assert roslib.message.get_service_class(kind) is not None, f"{page.parent.name}: {row.name} has unknown type {kind}"
        if row.section == "Actions":
            assert roslib.message.get_message_class(f"{kind.removesuffix('Action')}Action") is not None, f"{page.parent.name}: {row.name}: {kind}"


def test_a_section_that_is_there_has_rows(page: Path) -> None:
    text = page.read_text()
    for section in COLUMNS:
        if f"\n## {section}\n" in text:
            assert any(row.section == section for row in rows(page)), f"{page.parent.name}: {section} is empty"


def test_the_pages_of_the_nodes_say_what_they_offer() -> None:
    names = {row.name for page in pages() for row in rows(page)}
    assert {"joint_states", "control_log", "controller_manager/switch_controller", "sim/reset_simulation"} <= names
