"""Every package of the workspace has the pages and the manifest that its users and tools expect."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from catkin_pkg.package import parse_package

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent for path in ROOT.glob("src/*/package.xml"))


@pytest.fixture(params=PACKAGES, ids=lambda path: path.name)
def package(request: pytest.FixtureRequest) -> Path:
    return request.param


def test_the_workspace_has_its_packages() -> None:
    assert {"hric_control", "hric_bringup", "panda_description", "controller_manager_msgs"} <= {path.name for path in PACKAGES}


def test_a_manifest_is_format_3_and_valid(package: Path) -> None:
    assert ET.parse(package / "package.xml").getroot().get("format") == "3"
    warnings: list[str] = []
    manifest = parse_package(str(package / "package.xml"), warnings=warnings)
    assert warnings == []
    assert manifest.name == package.name
    assert manifest.licenses == ["Apache-2.0"] or "Apache-2.0" in manifest.licenses or package.name.endswith("_msgs")


def test_a_package_has_an_interface_page_and_a_changelog(package: Path) -> None:
    page = (package / "INTERFACE.md").read_text()
    assert page.startswith("#")
    changelog = (package / "CHANGELOG.rst").read_text()
    assert changelog.count("Forthcoming") == 1 or "\n0." in changelog
    assert any(line.lstrip().startswith(("*", "-")) and len(line) > 10 for line in changelog.splitlines()), "the changelog names no change"


def test_what_a_package_imports_from_the_workspace_is_in_its_manifest(package: Path) -> None:
    manifest = parse_package(str(package / "package.xml"))
    declared = {depend.name for depend in manifest.exec_depends + manifest.build_depends} | {package.name}
    # The package xacro has a command only; the Python module of that name is PyPI's.
    own_packages = {path.name for path in PACKAGES} - {"xacro"}
    imported = set()
    for source in [*package.glob("src/**/*.py"), *(path for path in package.glob("nodes/*") if path.is_file())]:
        for line in source.read_text().splitlines():
            words = line.split()
            if len(words) > 1 and words[0] in ("import", "from"):
                imported.add(words[1].split(".")[0])
    assert imported & own_packages <= declared
