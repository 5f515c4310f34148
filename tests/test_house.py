"""The code of the workspace is within its size limits, import layers and style, and the checks of these are correct."""

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from house import counts, imports, limits, prose, sample, sources  # noqa: E402
from house.__main__ import main  # noqa: E402
from house.sources import HouseError, Source  # noqa: E402
from house.twins import twins  # noqa: E402

Make = Callable[..., Path]
Captured = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def workspace() -> list[Source]:
    return sources.in_folder(ROOT)


@pytest.fixture(scope="module")
def today() -> limits.Limits:
    return limits.read_limits(ROOT)


def module(name: str, text: str) -> Source:
    """Return a source file with this module name and text."""
    return Source(f"src/{name.partition('.')[0]}/src/{name.replace('.', '/')}.py", text)


def test_sizes_are_within_their_limits(workspace: list[Source], today: limits.Limits) -> None:
    assert limits.over_sizes(workspace, today) == []


def test_no_more_functions_are_alike_than_allowed(workspace: list[Source], today: limits.Limits) -> None:
    assert limits.over_twins(workspace, today) == []


def test_imports_keep_their_contracts(capfd: pytest.CaptureFixture[str]) -> None:
    assert imports.main(ROOT) == 0, capfd.readouterr().out


def test_pages_and_code_keep_the_style(workspace: list[Source]) -> None:
    assert prose.findings([*prose.pages(ROOT), *prose.in_code(workspace)], *prose.style(ROOT)) == []


def test_public_class_names_are_unique(workspace: list[Source]) -> None:
    homes: dict[str, list[str]] = {}
    for source in workspace:
        for node in ast.walk(source.tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(source.path)
    assert {name: paths for name, paths in homes.items() if len(paths) > 1} == {}


@pytest.mark.slow
def test_start_statements_match_their_revision(today: limits.Limits) -> None:
    try:
        start = sources.at_revision(today.start["revision"], ROOT)
    except HouseError:
        pytest.skip("a clone without the history of the start")
    assert sum(size.statements for size in counts.by_package(start).values()) == today.start["statements"]


def test_statements_count_nested_without_docstrings() -> None:
    text = '"""Doc."""\nimport os\nA = 1\n"""Of A."""\n\n\ndef f():\n    """Doc."""\n'
    text += "    if A:\n        return os\n    elif f:\n        pass\n"
    assert counts.sizes(module("a.m", text)).statements == len(["import", "A", "def", "if", "return", "elif", "pass"])


def test_the_import_share_counts_code_lines() -> None:
    text = '"""Doc\n\nof the module."""\n\n# comment\nfrom a import (\n    b,  # why\n)\n\nx = """1\n\n2"""\ny = b\n'
    size = counts.sizes(module("a.m", text))
    assert (size.import_lines, size.code_lines) == (3, 3 + 2 + 1)
    assert size.import_share == 50.0


def test_modules_are_counted_per_folder() -> None:
    files = [module(name, "") for name in ("a.__init__", "a.x", "a.y", "a.sub.__init__", "a.sub.z")]
    files.append(Source("src/a/nodes/run", "#!/usr/bin/env python3\n"))
    assert counts.levels(files) == {"src/a/src/a": 2, "src/a/src/a/sub": 1}


def test_imported_modules_of_the_project_count_once_wherever_and_however_they_are_imported() -> None:
    text = "import numpy\nimport a.x\nfrom a import x, sub\nfrom a.y import f, g\nfrom a_msgs.msg import M, N\n"
    text += "def f():\n    from a import CONSTANT\n"
    imported = counts.imported_modules(module("b.m", text), {"a", "a.x", "a.y", "a.sub"}, {"a", "a_msgs"})
    assert imported == {"a", "a.x", "a.y", "a.sub", "a_msgs.msg"}


def test_a_module_that_imports_more_than_the_limit_is_named(today: limits.Limits) -> None:
    imports_ = [f"from hric_core.m{number} import x\n" for number in range(today.imported_modules + 1)]
    users = [module(f"hric_run.{name}", "".join(text)) for name, text in (("less", imports_[1:]), ("more", imports_))]
    findings = [text for text in limits.over_sizes(users, today) if text.startswith("imported_modules")]
    assert findings == ["imported_modules: 16, limit 15 in src/hric_run/src/hric_run/more.py"]


def test_a_function_beyond_the_limit_is_long() -> None:
    source = module("a.m", "class C:\n    def f(self):\n" + "        x = 1\n" * 4)
    assert counts.long_functions([source], 5) == []
    assert counts.long_functions([source], 4) == ["src/a/src/a/m.py:2 C.f (5 lines)"]


def test_only_product_python_is_counted(tmp_path: Path) -> None:
    product = ["src/a/src/a/m.py", "src/a/nodes/run", "scripts/tool", "scripts/lib/helper.py"]
    for path in [*product, "src/a/test/test_m.py", "src/a/setup.py", "src/a/templates/t/src/t/m.py", "tests/test_x.py"]:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("#!/usr/bin/env python3\n")
    (tmp_path / "scripts/setup").write_text("#!/usr/bin/env bash\n")
    assert [source.path for source in sources.in_folder(tmp_path)] == sorted(product)


def test_a_revision_is_counted_as_it_was(tmp_path: Path) -> None:
    def git(*arguments: str) -> None:
        identity = ["-c", "user.name=n", "-c", "user.email=e@example.org"]
        subprocess.run(["git", "-C", str(tmp_path), *identity, *arguments], check=True, capture_output=True)

    file = tmp_path / "scripts/tool.py"
    (tmp_path / "src/a/src/a").mkdir(parents=True)
    file.parent.mkdir()
    (tmp_path / "src/a/src/a/m.py").write_text("x = 1\n")
    file.write_text("x = 1\n")
    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "first")
    file.write_text("x = 1\ny = 2\n")
    assert sorted(source.text for source in sources.at_revision("HEAD", tmp_path)) == ["x = 1\n", "x = 1\n"]
    with pytest.raises(HouseError, match="no_such"):
        sources.at_revision("no_such", tmp_path)


def test_a_syntax_error_has_its_line() -> None:
    with pytest.raises(HouseError, match=r"src/a/src/a/m\.py:2"):
        counts.sizes(module("a.m", "x = 1\nx = = 2\n"))


BODY = """
def {name}(values, limit):
    total = 0.0
    for index, {item} in enumerate(values):
        if abs({item}) > limit:
            raise ValueError(f"{{index}} is beyond {{limit}}")
        total += {item} * {item}
    if total > {factor} * limit:
        return limit
    return total
"""


def test_functions_are_alike_though_their_local_names_differ() -> None:
    first = module("a.m", BODY.format(name="norm", item="value", factor=2))
    second = module("b.n", '"""Doc."""\n' + BODY.format(name="size", item="entry", factor=2))
    (pair,) = twins([first, second], 8, 0.95)
    assert pair.likeness == 1.0
    assert pair.names == {"a.m:norm", "b.n:size"}
    assert str(pair) == "1.00  src/a/src/a/m.py:2 norm  |  src/b/src/b/n.py:3 size"


def test_short_or_different_functions_are_not_alike() -> None:
    first = module("a.m", BODY.format(name="norm", item="value", factor=2))
    short = "def f(x):\n    return x\n"
    other = "def g(rows, out):\n" + "".join(f"    out.write_{word}(rows.{word})\n" for word in "abcdefgh")
    assert twins([first, module("b.n", other), module("a.s", short), module("b.s", short)], 8, 0.5) == []


def test_a_nested_function_is_no_twin() -> None:
    inner = "".join(f"    {line}\n" for line in BODY.format(name="inner", item="v", factor=2).splitlines())
    assert twins([module("a.m", f"def outer():\n{inner}    return inner\n")], 8, 0.1) == []


def listed_pair(*functions: str) -> dict[str, object]:
    entry = {"functions": list(functions), "reason": "each is faster"}
    return {"lines": 8, "likeness": 0.5, "pairs": 0, "exceptions": [entry]}


def test_a_stale_exception_is_a_finding(today: limits.Limits) -> None:
    pair = [module(f"{name}.m", BODY.format(name=name, item=name, factor=2)) for name in ("a", "b")]
    changed = limits.Limits(**{**vars(today), "twins": listed_pair("b.m:b", "a.m:a")})
    assert limits.over_twins(pair, changed) == []
    (finding,) = limits.over_twins(pair[:1], changed)
    assert "delete the exception a.m:a and b.m:b" in finding
    unlisted = limits.Limits(**{**vars(today), "twins": {**changed.twins, "exceptions": []}})
    assert limits.over_twins(pair, unlisted)[0] == "twins.pairs: 1, limit 0"


LINTED = """
[tool.importlinter]
root_packages = ["executables", "base", "top"]
include_external_packages = true
[[tool.importlinter.contracts]]
name = "downwards"
type = "layers"
layers = ["executables.top : top", "base"]
"""


@pytest.fixture
def two_layers(tmp_path: Path) -> Callable[..., int]:
    """Return a function that checks two packages, a node of the upper one and one more file, and returns the code."""

    def lint(path: str = "", text: str = "") -> int:
        files = {f"src/{name}/src/{name}/__init__.py": "" for name in ("base", "top")}
        files |= {"src/top/nodes/run": "#!/usr/bin/env python3\nimport base\n", "pyproject.toml": LINTED}
        for name, content in (files | ({path: text} if path else {})).items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(content)
        return imports.main(tmp_path)

    return lint


def test_imports_downwards_pass(two_layers: Callable[..., int]) -> None:
    assert two_layers() == 0


@pytest.mark.parametrize("text", ["import top", "def f():\n    from top import x", "if TYPE_CHECKING:\n    import top"])
def test_an_import_upwards_fails_wherever_it_is(two_layers: Callable[..., int], text: str) -> None:
    assert two_layers("src/base/src/base/m.py", text) == 1


@pytest.mark.parametrize("path", ["src/base/nodes/run", "src/lost/src/lost/__init__.py"])
def test_what_has_no_layer_is_refused(two_layers: Callable[..., int], path: str) -> None:
    with pytest.raises(HouseError, match="is not listed"):
        two_layers(path, "#!/usr/bin/env python3\n")


def refused(path: str, text: str) -> list[str]:
    """Return the names of the style rules that refuse a text, with the line."""
    return [
        line.partition(":")[2].partition(":")[0]
        for line in prose.findings([prose.Text(path, "f:1", text)], *prose.style(ROOT))
    ]


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        ("1 HRIC.Opening", "Of the command."),
        ("1 HRIC.Opening", "Whether it runs."),
        ("1 HRIC.Person", "Pose of his hand."),
        ("2 HRIC.Reported", "A lost scheduler\nis\nsaid."),
        ("1 HRIC.Ordinals", "saturated for the 3. time"),
        ("1 HRIC.Ordinals", "saturated for the .... time"),
        ("1 HRIC.Riddles", "Take what is so and give it."),
        ("1 HRIC.Replaced", "Wanted pose."),
    ],
)
def test_a_docstring_against_the_style_is_refused(rule: str, text: str) -> None:
    assert refused("build/texts/docstrings/a.txt", text) == [rule]


@pytest.mark.parametrize(
    ("path", "text", "rules"),
    [
        ("docs/a.md", "Two persons are told apart.", []),
        ("build/texts/names/a.txt", "told_pose", ["1 HRIC.Names"]),
        ("build/texts/names/a.txt", "rotatum_limit", []),
        ("build/texts/printed/a.txt", "Of three, the largest.", []),
        ("docs/a.md", "Of three. He is told.", ["1 HRIC.Person", "1 HRIC.Reported"]),
        ("src/a/CHANGELOG.rst", "wanted", []),
    ],
)
def test_rules_apply_where_the_configuration_has_them(path: str, text: str, rules: list[str]) -> None:
    assert refused(path, text) == rules


def test_texts_of_code_have_their_kind_and_line() -> None:
    text = '"""Doc of m."""\nmaxEffort = f"{1} is large"  # why\nraise ValueError("too large")\nx = "key"\n'
    texts = [(item.path.split("/")[2], item.location[-1], item.text) for item in prose.in_code([module("a.m", text)])]
    assert texts == [
        ("docstrings", "1", "Doc of m."),
        ("comments", "2", "# why"),
        ("printed", "2", "... is large"),
        ("printed", "3", "too large"),
        ("names", "4", "x"),
        ("names", "2", "max_effort"),
        ("names", "1", "m"),
    ]


def test_code_and_addresses_are_no_prose(tmp_path: Path) -> None:
    page = "`he` and [page](he.md)\n```bash\nhe\n```\n<!-- he -->\nhim\n"
    (tmp_path / "README.md").write_text(page)
    (line,) = prose.findings(prose.pages(tmp_path), *prose.style(ROOT))
    assert line.startswith("README.md:6 HRIC.Person: 'him'")


def test_a_rule_that_only_vale_knows_is_refused(small: Make, capsys: Captured) -> None:
    root = small()
    (root / "styles/HRIC/Other.yml").write_text("extends: metric\nmessage: m\n")
    assert main(["--prose"], root) == 2
    assert "existence and substitution" in capsys.readouterr().err


CONFIG = """
[tool.hric.house]
start = { revision = "r", statements = 4 }
statements = 2
import_share = 9.0
modules_per_level = 1
imported_modules = 0
function_lines = 4
short_modules = 1
short_module_lines = 40
twins = { lines = 8, likeness = 0.5, pairs = 0, exceptions = [] }
"""


@pytest.fixture
def small(tmp_path: Path) -> Make:
    """Return a function that makes a workspace of one module with the limits of CONFIG, with one text replaced."""

    def make(replaced: str = "") -> Path:
        (tmp_path / "src/hric_control/src/hric_control").mkdir(parents=True)
        (tmp_path / "src/hric_control/src/hric_control/m.py").write_text("x = 1\ny = 2\n")
        (tmp_path / "styles/HRIC").mkdir(parents=True)
        (tmp_path / ".vale.ini").write_text("StylesPath = styles\n")
        before, _, after = replaced.partition(" -> ")
        (tmp_path / "pyproject.toml").write_text(CONFIG.replace(before, after) if before else CONFIG)
        return tmp_path

    return make


def test_a_workspace_within_its_limits_passes_the_check(small: Make, capsys: Captured) -> None:
    root = small()
    assert main(["--check"], root) == 0
    assert capsys.readouterr().out == "all within the limits\n"
    assert main([], root) == 0
    assert "-50.00 % statements against 4 at r" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        ("statements = 2 -> statements = 1", "statements: 2, limit 1"),
        ("modules_per_level = 1 -> modules_per_level = 0", "modules_per_level: 1, limit 0 in src/hric_control/src"),
        ("short_modules = 1 -> short_modules = 0", "short_modules: 1, limit 0"),
    ],
)
def test_the_check_says_what_is_beyond_which_limit(small: Make, capsys: Captured, replaced: str, message: str) -> None:
    assert main(["--check"], small(replaced)) == 1
    assert capsys.readouterr().out.startswith(message)


def test_a_misspelt_limit_is_refused(small: Make, capsys: Captured) -> None:
    assert main([], small("function_lines -> function_line")) == 2
    message = capsys.readouterr().err
    assert "function_line, function_lines" in message and "import_share" in message


def test_the_command_runs_without_the_workspace_environment() -> None:
    command = [str(ROOT / "scripts/count"), "--at", "no_such"]
    result = subprocess.run(command, env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True)
    assert result.returncode == 2
    assert "no_such" in result.stderr


def test_a_sample_is_drawn_by_its_seed(small: Make, capsys: Captured) -> None:
    root = small()
    text = "".join(f'def f{k}():\n    """Return {k}."""\n    raise ValueError("no {k}")\n' for k in range(9))
    (root / "src/hric_control/src/hric_control/m.py").write_text(text)
    drawn = []
    for words in (["docstrings", "3", "--seed", "1"], ["docstrings", "3", "--seed", "1"], ["docstrings", "3"]):
        assert sample.main(words, root) == 0
        drawn.append(capsys.readouterr().out)
    assert drawn[0] == drawn[1] != drawn[2] and drawn[0].count("def f") == 3 and "  Return " in drawn[0]
    assert sample.main(["logs", "9"], root) == 0
    assert "m.py:3\n  no 0\n" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        sample.main(["pages", "1"], root)
    assert "there are no pages" in capsys.readouterr().err
