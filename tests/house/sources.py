"""Python source files of the workspace without tests, from its folder or from a git revision."""

import ast
import io
import re
import subprocess
import tarfile
import tokenize
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath

Function = ast.FunctionDef | ast.AsyncFunctionDef
WORKSPACE = Path(__file__).resolve().parents[2]
PRODUCT = re.compile(r"src/[^/]+/(src|nodes)/.+|scripts/.+")
"""Pattern of the paths of product code, without tests, setup.py and templates."""
SHEBANG = re.compile(rb"#!.*\bpython")
NO_CODE = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
"""Types of tokens that are not code: a line with only these is no code line."""


class HouseError(Exception):
    """Error of a file, revision or configuration that cannot be read; the message has the reason."""


@dataclass(frozen=True)
class Source:
    """A Python file.

    Attributes:
        path: path relative to the workspace, with slashes.
        text: content of the file.
    """

    path: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """Syntax tree of the file; raises HouseError if it cannot be parsed."""
        try:
            return ast.parse(self.text)
        except SyntaxError as error:
            raise HouseError(f"{self.path}:{error.lineno}: {error.msg}") from error

    @cached_property
    def nodes(self) -> list[ast.AST]:
        """All nodes of the syntax tree, outer nodes first."""
        return list(ast.walk(self.tree))

    @property
    def package(self) -> str:
        """Name of the package, which is the folder below src, or "scripts"."""
        top, below = PurePosixPath(self.path).parts[:2]
        return below if top == "src" else top

    @property
    def name(self) -> str:
        """Name for imports; for executables `package/nodes/name`, for files in scripts the path without `.py`."""
        parts = PurePosixPath(self.path).with_suffix("").parts
        if parts[0] == "scripts":
            return "/".join(parts)
        if parts[2] == "nodes":
            return "/".join(parts[1:])
        return ".".join(parts[3:-1] if parts[-1] == "__init__" else parts[3:])

    @property
    def level(self) -> str:
        """Folder whose modules are counted together; "" for executables and `__init__`, which are not counted."""
        path = PurePosixPath(self.path)
        return str(path.parent) if path.suffix == ".py" and path.stem not in ("__init__", "__main__") else ""

    @cached_property
    def functions(self) -> list[tuple[str, Function]]:
        """All functions and methods, including nested ones, with their qualified names within the module."""
        return list(_functions(self.tree, ""))

    @property
    def docstrings(self) -> list[tuple[int, str]]:
        """First line and text of each docstring, including docstrings of constants."""
        strings = [node for node in self.nodes if is_docstring(node) and isinstance(node, ast.Expr)]
        return [(node.lineno, ast.literal_eval(node.value)) for node in strings]

    @cached_property
    def code_lines(self) -> set[int]:
        """Numbers of the lines that are not blank, comment or docstring."""
        tokens = tokenize.generate_tokens(io.StringIO(self.text).readline)
        code = (token for token in tokens if token.type not in NO_CODE)
        lines = {line for token in code for line in range(token.start[0], token.end[0] + 1)}
        lines -= {index for index, line in enumerate(self.text.splitlines(), 1) if not line.strip()}
        return lines - covered(node for node in self.nodes if is_docstring(node))


def is_docstring(node: ast.AST) -> bool:
    """Return True if a node is a string expression: the docstring of a module, class, function or constant."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def covered(nodes: Iterable[ast.AST]) -> set[int]:
    """Return the numbers of the lines that these nodes cover."""
    statements = (node for node in nodes if isinstance(node, ast.stmt))
    return {line for node in statements for line in range(node.lineno, (node.end_lineno or 0) + 1)}


def in_folder(root: Path = WORKSPACE) -> list[Source]:
    """Return the product code in the folder of a workspace; raise HouseError if it cannot be read."""
    paths = (path for top in ("src", "scripts") for path in sorted((root / top).rglob("*")) if path.is_file())
    return _chosen((path.relative_to(root).as_posix(), path.read_bytes()) for path in paths)


def at_revision(revision: str, root: Path = WORKSPACE) -> list[Source]:
    """Return the product code of a git revision without checking it out; raise HouseError if it does not exist."""
    command = ["git", "-C", str(root), "archive", "--format=tar", revision, "--", "src", "scripts"]
    result = subprocess.run(command, capture_output=True)
    if result.returncode != 0:
        raise HouseError(f"cannot read revision {revision!r}: {result.stderr.decode().strip()}")
    with tarfile.open(fileobj=io.BytesIO(result.stdout)) as archive:
        members = ((member.name, archive.extractfile(member)) for member in archive if member.isfile())
        return _chosen((name, file.read()) for name, file in members if file)


def _chosen(files: Iterable[tuple[str, bytes]]) -> list[Source]:
    chosen = [Source(path, content.decode()) for path, content in files if _is_python(path, content)]
    if not chosen:
        raise HouseError("no Python below src/*/src, src/*/nodes and scripts: is this the workspace's top folder?")
    return sorted(chosen, key=lambda source: source.path)


def _is_python(path: str, content: bytes) -> bool:
    if not PRODUCT.fullmatch(path):
        return False
    return path.endswith(".py") or ("." not in PurePosixPath(path).name and SHEBANG.match(content) is not None)


def _functions(node: ast.AST, prefix: str) -> Iterator[tuple[str, Function]]:
    for child in ast.iter_child_nodes(node):
        named = isinstance(child, Function | ast.ClassDef)
        name = prefix + child.name if isinstance(child, Function | ast.ClassDef) else prefix
        if isinstance(child, Function):
            yield name, child
        yield from _functions(child, f"{name}." if named else prefix)
