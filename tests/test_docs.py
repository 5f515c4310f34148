"""scripts/docs checks its arguments before it installs anything; the site of the manual has every page."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
import docs_hooks  # noqa: E402

PAGE = re.compile(r"[\w/.]+\.md$", re.MULTILINE)


def docs(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(ROOT / "scripts/docs"), *arguments], capture_output=True, text=True, timeout=30)


def test_help_is_there_without_an_installation() -> None:
    told = docs("--help")
    assert (told.returncode, told.stderr) == (0, "")
    assert "--serve" in told.stdout


@pytest.mark.parametrize("arguments", [["--fast"], ["--serve", "--check"], ["site"]])
def test_an_unknown_option_is_refused_with_the_valid_ones(arguments: list[str]) -> None:
    told = docs(*arguments)
    assert told.returncode == 2
    assert "valid: --serve or --check" in told.stderr


def test_the_navigation_has_every_page_that_is_written_or_made_once() -> None:
    written = [str(path.relative_to(ROOT / "docs")) for path in ROOT.glob("docs/**/*.md")]
    made = [name for name, _ in docs_hooks.pages(ROOT)]
    assert sorted(PAGE.findall((ROOT / "mkdocs.yml").read_text())) == sorted(written + made)


def test_modules_whose_docstrings_are_pages_have_what_the_pages_choose() -> None:
    for module, members in docs_hooks.PYTHON.items():
        tree = ast.parse((ROOT / f"src/{module.partition('.')[0]}/src/{module.replace('.', '/')}.py").read_text())
        defined = {node.name for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}
        assert set(members) <= defined, module


@pytest.mark.parametrize(
    ("text", "escaped"),
    [
        ("`point` [x, y] [m], duration [s][, body]", "`point` [x, y\\] [m], duration [s\\][, body]"),
        ("`a[0][1]` and\n```\n[a] [b]\n```", "`a[0][1]` and\n```\n[a] [b]\n```"),
        ("[page](there.md)", "[page](there.md)"),
    ],
)
def test_a_quantity_with_its_unit_is_no_link(text: str, escaped: str) -> None:
    assert docs_hooks.without_links_of_units(text) == escaped


def test_comments_for_the_tests_of_the_manual_are_not_in_the_site() -> None:
    text = "a\n<!-- terminal 2 -->\n```bash\nls\n```\n| `<!-- stays -->` |\n"
    assert docs_hooks.on_page_markdown(text) == "a\n\n```bash\nls\n```\n| `<!-- stays -->` |\n"


def test_the_picture_of_the_readme_moves_and_is_small() -> None:
    (picture,) = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", (ROOT / "README.md").read_text())
    assert (ROOT / picture).stat().st_size < 1.5e6
    with Image.open(ROOT / picture) as image:
        assert getattr(image, "n_frames", 1) > 20


def test_the_release_notes_name_each_package_with_changes_to_come() -> None:
    logs = {path.parent.name: path.read_text() for path in ROOT.glob("src/*/CHANGELOG.rst")}
    changed = {package for package, text in logs.items() if "\nForthcoming\n" in text}
    assert changed
    coming, _, _ = (ROOT / "docs/release_notes.md").read_text().partition("\n## 0.2.0")
    assert {package for package in changed if f"`{package}`" not in coming} == set()
