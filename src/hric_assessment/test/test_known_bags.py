"""Ten bags from closed forms, whose findings are known by construction: all ten come out."""

import ast
import json
from pathlib import Path

import jsonschema
import known_bags
import pytest
from known_bags import Known

from hric_core.command import perform

SCHEMA = Path(__file__).parents[1] / "config" / "verdict.schema.json"
NAMES = ("within", "above", "clamped", "head", "rigid", "no_area", "approach", "posture", "sweep", "nothing")


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Known]]:
    folder = tmp_path_factory.mktemp("bags")
    return folder, {known.name: known for known in known_bags.write(folder)}


def test_the_script_uses_nothing_of_the_package() -> None:
    tree = ast.parse(Path(known_bags.__file__).read_text())
    imported = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    imported |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert "rosbags.rosbag1" in imported and not any(name.startswith("hric_assessment") for name in imported)


def test_there_are_ten(bags: tuple[Path, dict[str, Known]]) -> None:
    assert tuple(bags[1]) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_what_is_known_comes_out(name: str, bags: tuple[Path, dict[str, Known]]) -> None:
    folder, known = bags[0], bags[1][name]
    code = perform(["assess", str(folder / f"{name}.bag"), *known.options])
    verdict = json.loads((folder / f"{name}_verdict.json").read_text())
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text())).validate(verdict)
    found = [one for one in verdict["findings"] if one["group"] == known.group]
    if name == "posture":
        assert postures(found) == {("RULA", "right"): 3.0, ("REBA", "right"): 2.0, ("RULA", "left"): 2.0}
        found = found[:1]
    assert tuple(one["outcome"] for one in found) == known.outcomes
    for value_name, expected in known.values.items():
        values = {"share": found[0]["share"], **found[0]["values"]}
        (value,) = (value for key, value in values.items() if key == value_name or key.startswith(f"{value_name} ["))
        assert value == pytest.approx(expected, rel=2e-3), value_name
    assert known.reason in (found[0]["reason"] if found else "")
    figures = {one["name"]: one["value"] for one in verdict["figures"] if one["group"] == known.group}
    for figure, expected in known.figures.items():
        assert figures[figure] == pytest.approx(expected, abs=2e-3), figure
    lacking = " ".join(one["signal"] for one in verdict["missing"])
    assert all(words in lacking for words in known.missing)
    assert known.code is None or code == known.code


def postures(found: list[dict[str, object]]) -> dict[tuple[str, str], object]:
    """Return the posture scores that count, for bags whose expected values state them."""
    scores = {}
    for one in found:
        method, _, _, side, _ = str(one["subject"]).split(" ")
        scores[method, side] = one["values"]["score that counts"]  # type: ignore[index]
    scores.pop(("REBA", "left"))
    return scores
