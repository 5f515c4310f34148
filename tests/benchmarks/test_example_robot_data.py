"""Table of example-robot-data in the manual: its contents, and the program that makes it."""

import re
from pathlib import Path

import pytest
from example_robot_data import PAGE, main, robots

ROBOTS, LEAST = 69, 58
ROBOT = """<robot name="{name}"><link name="base"/>
  <link name="arm"><inertial><mass value="1"/><inertia ixx="{ixx}" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="{child}"/><axis xyz="0 0 1"/></joint></robot>"""  # noqa: E501


def results(page: str) -> dict[str, str]:
    """Results by URDF, from the first table of the page."""
    cells = [
        [cell.strip() for cell in line.split("|")]
        for line in page.splitlines()
        if line.startswith("| ") and ".urdf" in line
    ]
    return {row[1]: row[3] for row in cells if len(row) > 10}


def forward_runs(page: str) -> dict[str, tuple[float, float]]:
    """Real-time factors with and without friction by URDF, from the second table of the page."""
    rows = re.findall(r"^\| (\S+\.urdf) \| (\S+) \| (\S+) \| \S+ \| [^|]*\|$", page, flags=re.MULTILINE)
    return {name: (float(with_friction), float(without)) for name, with_friction, without in rows}


def test_the_page_in_the_docs_has_every_robot_and_explains_each_that_did_not_pass_as_it_is() -> None:
    page = PAGE.read_text()
    found = results(page)
    assert len(found) == ROBOTS
    assert sum(result.startswith("passes") for result in found.values()) >= LEAST
    explained = set(re.findall(r"^- (\S+\.urdf): .{20}", page, flags=re.MULTILINE))
    assert explained == {name for name, result in found.items() if result != "passes"}


def test_no_robot_with_a_joint_is_slow_forward_because_of_its_friction() -> None:
    page = PAGE.read_text()
    runs = forward_runs(page)
    passed = {row for row, result in results(page).items() if result.startswith("passes")}
    assert len(passed) - len(runs) == 2, "two of them have no joint"
    assert [name for name, (with_friction, without) in runs.items() if with_friction < without / 3.0] == []
    assert [name for name, (with_friction, without) in runs.items() if with_friction < 0.2 <= without] == []


def test_a_run_over_three_robots_tells_what_passed_what_needed_an_option_and_what_was_refused(tmp_path: Path) -> None:
    data = tmp_path / "share/some-robots"
    (data / "robots/one").mkdir(parents=True)
    (data / "package.xml").write_text("<package><name>of_another_name</name></package>")
    for name, ixx, child in (("good", 0.1, "arm"), ("flat", 0.9, "arm"), ("torn", 0.1, "leg")):
        (data / f"robots/one/{name}.urdf").write_text(ROBOT.format(name=name, ixx=ixx, child=child))
    main(["--data", str(tmp_path), "--output", str(tmp_path / "page.md")])
    page = (tmp_path / "page.md").read_text()
    assert results(page) == {
        "one/good.urdf": "passes",
        "one/flat.urdf": "passes, `--inertia repair`",
        "one/torn.urdf": "refused",
    }
    assert "**2 of 3 pass**, 1 of them with the default options" in page
    assert re.search(r"^- one/torn\.urdf: .*'leg'", page, flags=re.MULTILINE)
    assert re.search(r"^- one/flat\.urdf: .*arm", page, flags=re.MULTILINE)
    assert str(tmp_path) not in page
    (forward, frictionless) = forward_runs(page)["one/good.urdf"]
    assert forward > 0.2 and frictionless > 0.2


@pytest.mark.slow
def test_the_package_gives_the_results_that_stand_in_the_docs(tmp_path: Path) -> None:
    main(["--output", str(tmp_path / "page.md")])
    assert results((tmp_path / "page.md").read_text()) == results(PAGE.read_text())


def test_robots_are_found_in_any_depth(tmp_path: Path) -> None:
    for name in ("a/b/one.urdf", "two.urdf", "three.xacro"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    assert [path.name for path in robots(tmp_path)] == ["one.urdf", "two.urdf"]
