"""Words that the glossary replaces, searched in names, docstrings and comments."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from operator import itemgetter
from pathlib import PurePosixPath

from house.sources import Function, HouseError, Source

HEADER = ["say", "instead of", "exceptions"]
IN_SENTENCES = "in sentences"
"""Among the exceptions of a row: its words are refused in names only."""
NAMES, DOCSTRINGS, COMMENTS = "names", "docstrings", "comments"


@dataclass(frozen=True)
class Word:
    """A word that is replaced.

    Attributes:
        text: as the glossary has it; may be several words.
        in_sentences: whether docstrings and comments may use it.
        allowed: patterns of names that may contain it, as `name` or `module.name`.
    """

    text: str
    in_sentences: bool
    allowed: tuple[str, ...]

    @cached_property
    def parts(self) -> list[str]:
        """Its words as parts of a name."""
        return re.findall(r"\w+", self.text.lower())

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        """Finds it in sentences, also over the end of a line."""
        return re.compile(r"(?<!\w)" + r"[\s-]+".join(self.parts) + r"(?!\w)", re.IGNORECASE)

    def is_in(self, parts: Sequence[str]) -> bool:
        """Whether a name of these parts contains it."""
        return any(list(parts[start : start + len(self.parts)]) == self.parts for start in range(len(parts)))

    def allows(self, name: str, module: str) -> bool:
        """Whether a name of a module is an exception."""
        return any(fnmatchcase(full, pattern) for pattern in self.allowed for full in (name, f"{module}.{name}"))


@dataclass(frozen=True)
class Use:
    """A replaced word in use.

    Attributes:
        word: as the glossary has it.
        package, location: where; location is path:line.
        kind: NAMES, DOCSTRINGS or COMMENTS.
        text: the name, or the line.
    """

    word: str
    package: str
    location: str
    kind: str
    text: str


def read_glossary(page: str, path: str) -> list[Word]:
    """The table of words of a glossary page.

    Between backticks, "instead of" has the replaced words, "exceptions" patterns of names that may contain them.

    Raises:
        HouseError: no such table, or a row of another form.
    """
    words: list[Word] = []
    inside = False
    for row, line in enumerate(page.splitlines(), 1):
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")] if line.startswith("|") else []
        if cells == HEADER:
            inside = True
        elif not cells:
            inside = False
        elif inside and not set(cells[0]) <= set(":-"):
            replaced = re.findall(r"`([^`]+)`", cells[1]) if len(cells) == len(HEADER) else []
            if not replaced:
                raise HouseError(f"{path}:{row}: a row needs {len(HEADER)} cells, and `words` in the second")
            allowed = tuple(re.findall(r"`([^`]+)`", cells[2]))
            words += [Word(text, IN_SENTENCES in cells[2], allowed) for text in replaced]
    if not words:
        raise HouseError(f"{path}: no table with the columns {' | '.join(HEADER)}")
    return words


def uses(sources: Sequence[Source], words: Sequence[Word]) -> list[Use]:
    """Uses that no exception allows: of names one per file, at the first definition; in sentences each."""
    return [use for source in sources for use in [*_in_names(source, words), *_in_sentences(source, words)]]


def parts_of(name: str) -> list[str]:
    """Parts of a name in lower case: `maxEffort_rate` -> max, effort, rate."""
    return [part.lower() for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


def _in_names(source: Source, words: Sequence[Word]) -> Iterator[Use]:
    first: dict[str, int] = {}
    for name, line in sorted(_names(source), key=itemgetter(1)):
        first.setdefault(name, line)
    for name, line in first.items():
        parts = parts_of(name)
        for word in words:
            if word.is_in(parts) and not word.allows(name, source.name):
                yield Use(word.text, source.package, f"{source.path}:{line}", NAMES, name)


def _names(source: Source) -> Iterator[tuple[str, int]]:
    """Names that a file defines, its own (a package's for `__init__`) first."""
    path = PurePosixPath(source.path)
    yield path.parent.name if path.stem == "__init__" else path.stem, 1
    for node in source.nodes:
        if isinstance(node, Function | ast.ClassDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno


def _in_sentences(source: Source, words: Sequence[Word]) -> Iterator[Use]:
    texts = [(DOCSTRINGS, line, text) for line, text in source.docstrings]
    tokens = tokenize.generate_tokens(io.StringIO(source.text).readline)
    texts += [(COMMENTS, token.start[0], token.string) for token in tokens if token.type == tokenize.COMMENT]
    for kind, line, text in texts:
        for word in words:
            if not word.in_sentences:
                for match in word.pattern.finditer(text):
                    offset = text.count("\n", 0, match.start())
                    location = f"{source.path}:{line + offset}"
                    yield Use(word.text, source.package, location, kind, text.splitlines()[offset].strip())
