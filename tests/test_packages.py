"""Every package of the workspace has a valid manifest, an INTERFACE.md and a changelog."""

import xml.etree.ElementTree as ET
from itertools import islice
from pathlib import Path

import pytest
import yaml
from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package import parse_package
from catkin_pkg.topological_order import topological_order_packages

ROOT = Path(__file__).resolve().parents[1]
# Of Debian's catkin_pkg on a newer docutils.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
PACKAGES = sorted(path.parent for path in ROOT.glob("src/*/package.xml"))


@pytest.fixture(params=PACKAGES, ids=lambda path: path.name)
def package(request: pytest.FixtureRequest) -> Path:
    return request.param


def test_the_workspace_has_its_packages() -> None:
    assert {"hric_control", "hric_bringup", "panda_description", "controller_manager_msgs"} <= {
        path.name for path in PACKAGES
    }


def test_no_package_waits_for_itself_so_that_catkin_can_build_them_in_an_order() -> None:
    """Check all dependencies, including those of tests."""
    ordered = topological_order_packages({path.name: parse_package(str(path / "package.xml")) for path in PACKAGES})
    assert [str(names) for name, names in ordered if name is None] == []
    assert len(ordered) == len(PACKAGES)


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
    releases = get_changelog_from_path(str(package)).foreach_version()
    assert all(changes for _, _, changes in releases)
    assert "\n* " in (package / "CHANGELOG.rst").read_text(), "the changelog names no change"


def test_the_packages_the_newest_section_of_their_changelogs_and_the_citation_have_one_version() -> None:
    found = {"CITATION.cff": yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"]}
    for path in PACKAGES:
        found[f"{path.name}/package.xml"] = parse_package(str(path / "package.xml")).version
        for version, _, _ in islice(get_changelog_from_path(str(path)).foreach_version(), 1):  # none before the first
            found[f"{path.name}/CHANGELOG.rst"] = version
    assert len(set(found.values())) == 1, found


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
