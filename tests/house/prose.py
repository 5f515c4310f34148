"""Check of texts in pages and code by the style rules in styles/HRIC, which are in the format of the program vale.

No package registry contains vale itself, so this module implements the kinds of rule that the style uses
(`existence`, `substitution`). If vale is installed, it can use the same rules: see .vale.ini.
"""

import ast
import configparser
import io
import re
import tokenize
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from operator import itemgetter
from pathlib import Path, PurePosixPath
from typing import Any

from house.sources import WORKSPACE, Function, HouseError, Source, is_docstring

CONFIG = ".vale.ini"
PAGES = ("*.md", "docs/**/*.md", "src/*/INTERFACE.md", "src/*/CHANGELOG.rst")
PRINTED, COMMENTS, DOCSTRINGS, NAMES = "printed", "comments", "docstrings", "names"
"""Kinds of texts in code, which are also the names of their folders below build/texts."""
NO_PROSE = re.compile(
    r"^ *(```|~~~).*?^ *\1|<!--.*?-->|``[^`]+``|`[^`\n]*`|\]\([^)\s]*\)|https?://\S+", re.DOTALL | re.MULTILINE
)
"""Pattern of code, comments and addresses in a page, which are not checked."""


@dataclass(frozen=True)
class Text:
    """A text to check.

    Attributes:
        path: path of the file for vale, which selects the section of the configuration.
        location: file and line of the text.
        text: the text.
    """

    path: str
    location: str
    text: str


@dataclass(frozen=True)
class Rule:
    """A style rule.

    Attributes:
        name: names of style and file, such as HRIC.Person.
        pattern: pattern of refused words.
        message: message with `%s` for the match, or for replacement and match.
        swap: pairs of pattern and replacement; empty if the rule has no replacements.
        exceptions: matches that are allowed, in lower case.
    """

    name: str
    pattern: re.Pattern[str]
    message: str
    swap: tuple[tuple[re.Pattern[str], str], ...]
    exceptions: frozenset[str]

    def findings(self, text: Text) -> Iterator[str]:
        """Yield a message for each match in a text."""
        for match in self.pattern.finditer(text.text):
            if match[0].lower() not in self.exceptions:
                path, _, line = text.location.rpartition(":")
                words = [replacement for pattern, replacement in self.swap if pattern.fullmatch(match[0])][:1]
                message = self.message % (*words, " ".join(match[0].split()))
                yield f"{path}:{int(line) + text.text.count(chr(10), 0, match.start())} {self.name}: {message}"


def style(root: Path = WORKSPACE) -> tuple[list[Rule], configparser.ConfigParser]:
    """Return the style rules of a workspace, and the configuration that assigns them to files.

    Raises:
        HouseError: a rule is of a kind that this module does not implement.
    """
    import yaml  # imported here, since the other parts of scripts/count must run without PyYAML

    config = configparser.ConfigParser(delimiters="=", default_section="")
    config.optionxform = str  # type: ignore[method-assign, assignment]
    config.read_string("[top]\n" + (root / CONFIG).read_text())
    folder = root / config["top"]["StylesPath"]
    return [_rule(path, yaml.safe_load(path.read_text())) for path in sorted(folder.glob("*/*.yml"))], config


def _rule(path: Path, content: dict[str, Any]) -> Rule:
    known = {"extends", "message", "level", "ignorecase", "nonword", "tokens", "swap", "exceptions"}
    if content.get("extends") not in ("existence", "substitution") or set(content) - known:
        raise HouseError(f"{path}: only existence and substitution, with {', '.join(sorted(known))}, are read here")
    flags = re.IGNORECASE if content.get("ignorecase") else re.NOFLAG
    swap = content.get("swap", {})
    parts = "|".join(part.replace(" ", r"\s+") for part in (*content.get("tokens", ()), *swap))
    pattern = f"(?:{parts})" if content.get("nonword") else rf"\b(?:{parts})\b"
    swaps = tuple((re.compile(part.replace(" ", r"\s+"), flags), str(word)) for part, word in swap.items())
    exceptions = frozenset(map(str.lower, content.get("exceptions", ())))
    name = f"{path.parent.name}.{path.stem}"
    return Rule(name, re.compile(pattern, flags), content["message"], swaps, exceptions)


def findings(texts: Sequence[Text], rules: Sequence[Rule], config: configparser.ConfigParser) -> list[str]:
    """Return a message for each violation of the style in the texts."""
    applied: dict[tuple[str, ...], list[Rule]] = {}
    lines: list[str] = []
    for text in texts:
        sections = tuple(name for name in config.sections() if any(fnmatch(text.path, glob) for glob in _globs(name)))
        if sections not in applied:
            applied[sections] = [rule for rule in rules if _applies(rule.name, config, sections)]
        lines += [line for rule in applied[sections] for line in rule.findings(text)]
    return lines


def _globs(section: str) -> list[str]:
    """Return the file patterns of a section's name; alternatives such as `{md,rst}` are expanded."""
    head, brace, rest = section.partition("{")
    choices, _, tail = rest.partition("}")
    return [f"{head}{choice}{tail}" for choice in choices.split(",")] if brace else [section]


def _applies(rule: str, config: configparser.ConfigParser, sections: Sequence[str]) -> bool:
    applies = False
    for section in sections:
        applies = applies or rule.partition(".")[0] in config[section].get("BasedOnStyles", "").split(", ")
        applies = {"YES": True, "NO": False}.get(config[section].get(rule, ""), applies)
    return applies


def pages(root: Path = WORKSPACE) -> list[Text]:
    """Return the pages of a workspace, without code."""
    paths = sorted({path for glob in PAGES for path in root.glob(glob)})
    names = [path.relative_to(root).as_posix() for path in paths]
    return [Text(name, f"{name}:1", _prose(path.read_text())) for name, path in zip(names, paths, strict=True)]


def _prose(page: str) -> str:
    """Return a page in which code is replaced by spaces, so that line numbers do not change."""
    return NO_PROSE.sub(lambda match: re.sub(r"[^\n]+", " ", match[0]), page)


def in_code(sources: Sequence[Source]) -> list[Text]:
    """Return texts and names in code: docstrings, comments, printed strings, and each name once per file."""
    return [
        Text(f"build/texts/{kind}/{source.path.replace('/', '.')}.txt", f"{source.path}:{line}", text)
        for source in sources
        for kind, line, text in [
            *((DOCSTRINGS, line, text) for line, text in source.docstrings),
            *((COMMENTS, line, text) for line, text in _comments(source)),
            *((PRINTED, line, text) for line, text in printed(source.nodes)),
            *((NAMES, line, "_".join(parts_of(name))) for name, line in _names(source).items()),
        ]
    ]


def write(texts: Sequence[Text], folder: Path) -> None:
    """Write the texts of code into files for vale, in paragraphs."""
    for path in {text.path for text in texts}:
        file = folder.joinpath(*PurePosixPath(path).parts[2:])
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n\n".join(text.text for text in texts if text.path == path) + "\n")


def parts_of(name: str) -> list[str]:
    """Return the words in a name in lower case: max, effort and rate for `maxEffort_rate`."""
    return [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


def _comments(source: Source) -> Iterator[tuple[int, str]]:
    for token in tokenize.generate_tokens(io.StringIO(source.text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def printed(nodes: Sequence[ast.AST]) -> Iterator[tuple[int, str]]:
    """Yield line and text of strings of several words, except docstrings; values in them are replaced by `...`."""
    formats = {id(node.format_spec) for node in nodes if isinstance(node, ast.FormattedValue)}
    formatted = [node for node in nodes if isinstance(node, ast.JoinedStr) and id(node) not in formats]
    parts = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
    yield from ((node.lineno, _string(node)) for node in formatted)
    docstrings = {id(node.value) for node in nodes if is_docstring(node) and isinstance(node, ast.Expr)}
    for node in nodes:
        if (
            isinstance(node, ast.Constant)
            and id(node) not in parts
            and id(node) not in docstrings
            and " " in (text := _string(node)).strip()
        ):
            yield node.lineno, text


def _string(node: ast.AST) -> str:
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(_string(value) or "..." for value in values)
    return ""


def _names(source: Source) -> dict[str, int]:
    """Return names that a file defines, with the lines of their first definitions."""
    path = PurePosixPath(source.path)
    lines = [(path.parent.name if path.stem == "__init__" else path.stem, 1)]
    for node in source.nodes:
        if isinstance(node, Function | ast.ClassDef):
            lines.append((node.name, node.lineno))
        elif isinstance(node, ast.arg):
            lines.append((node.arg, node.lineno))
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            lines.append((node.id, node.lineno))
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            lines.append((node.attr, node.lineno))
    return dict(sorted(lines, key=itemgetter(1), reverse=True))
