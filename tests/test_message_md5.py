"""Message packages with upstream names are binary compatible with upstream, and every field has a comment."""

import importlib
import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
UPSTREAM: dict[str, str] = yaml.safe_load((ROOT / "tests" / "upstream_md5.yaml").read_text())
PACKAGES = sorted({name.partition("/")[0] for name in UPSTREAM})
ACTION_PARTS = ("Action", "ActionGoal", "ActionFeedback", "ActionResult", "Goal", "Feedback", "Result")
DEFINITIONS = sorted(
    path
    for package in [*PACKAGES, "hric_msgs"]
    for kind in ("msg", "srv", "action")
    for path in (ROOT / "src" / package / kind).glob("*")
)


def generated(package: str) -> dict[str, type]:
    """Return the generated classes of a package by type name: messages, including parts of actions, and services."""
    found = {}
    for kind in ("msg", "srv"):
        if kind == "srv" and not (ROOT / "src" / package / kind).is_dir():
            continue
        module = importlib.import_module(f"{package}.{kind}")
        for name, value in vars(module).items():
            if hasattr(value, "_md5sum") and (kind == "msg" or hasattr(value, "_request_class")):
                found[f"{package}/{name}"] = value
    return found


def action_parts(package: str) -> set[str]:
    """Return the names of the types that are generated from the actions of a package."""
    return {
        f"{package}/{path.stem}{part}"
        for path in (ROOT / "src" / package / "action").glob("*.action")
        for part in ACTION_PARTS
    }


def test_the_list_names_the_five_packages_with_upstream_names() -> None:
    assert PACKAGES == ["control_msgs", "controller_manager_msgs", "franka_gripper", "franka_msgs", "gazebo_msgs"]


@pytest.mark.parametrize("name", UPSTREAM)
def test_a_generated_class_has_the_md5sum_of_upstream(name: str) -> None:
    assert generated(name.partition("/")[0])[name]._md5sum == UPSTREAM[name]  # type: ignore[attr-defined]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_generated_definition_is_in_the_list(package: str) -> None:
    assert set(generated(package)) - action_parts(package) <= set(UPSTREAM)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_action_is_in_the_list(package: str) -> None:
    actions = {f"{package}/{path.stem}Action" for path in (ROOT / "src" / package / "action").glob("*.action")}
    assert actions <= set(UPSTREAM)


@pytest.mark.parametrize("path", DEFINITIONS, ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_every_field_of_a_definition_is_explained(path: Path) -> None:
    lines = [line for line in path.read_text().splitlines() if line.strip() and line.strip() != "---"]
    assert lines[0].startswith("# ")
    bare = [line for line in lines if not line.startswith("#") and not re.search(r"#\s*\S", line)]
    assert bare == []


@pytest.mark.parametrize("package", [*PACKAGES, "hric_msgs"])
def test_the_interface_page_lists_every_definition_and_no_other(package: str) -> None:
    page = (ROOT / "src" / package / "INTERFACE.md").read_text()
    listed = set(re.findall(rf"^\| `({package}/\w+)` \| (message|service|action) \|", page, re.MULTILINE))
    kinds = {"msg": "message", "srv": "service", "action": "action"}
    assert listed == {
        (f"{package}/{path.stem}", kinds[path.parent.name]) for path in DEFINITIONS if path.parents[1].name == package
    }
