"""Command line of scripts/sample."""

import argparse
import ast
import random
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from house.prose import printed
from house.sources import WORKSPACE, Function, HouseError, Source, in_folder

PAGES = ("README.md", "CONTRIBUTING.md", "docs/**/*.md", "src/*/INTERFACE.md")
LOGS = {"print", "debug", "info", "warn", "warning", "error", "exception", "critical", "fatal"}
"""Names of functions that print or log a text."""
MAX_CODE = 40
"""Maximum length of the code of a value that is shown in a text."""


def main(arguments: Sequence[str] | None = None, root: Path = WORKSPACE) -> int:
    """Print a random sample of texts, and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="scripts/sample", description="Print random texts of the workspace, to be read by a newcomer."
    )
    parser.add_argument("kind", choices=KINDS, help="kind of texts; logs: logged, printed and raised texts")
    parser.add_argument("number", type=int, help="number of texts")
    parser.add_argument("--seed", type=int, default=0, help="seed of the random choice (default: 0)")
    options = parser.parse_args(arguments)
    try:
        texts = KINDS[options.kind](root)
    except (HouseError, OSError) as error:
        print(f"scripts/sample: {error}", file=sys.stderr)
        return 2
    if not 0 < options.number <= len(texts):
        parser.error(
            f"number is {options.number}; valid: 1 to {len(texts)}" if texts else f"there are no {options.kind}"
        )
    print(*sorted(random.Random(options.seed).sample(texts, options.number)), sep="\n\n")
    return 0


def _docstrings(root: Path) -> list[str]:
    return [text for source in in_folder(root) for text in _described(source)]


def _described(source: Source) -> list[str]:
    described = []
    for node in source.nodes:
        if isinstance(node, Function | ast.ClassDef | ast.Module) and (text := ast.get_docstring(node)):
            line = 1 if isinstance(node, ast.Module) else node.lineno
            described.append(f"{source.path}:{line} {_signature(node)}\n  " + text.replace("\n", "\n  "))
    return described


def _signature(node: ast.AST) -> str:
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            returned = f" -> {ast.unparse(node.returns)}" if node.returns else ""
            return f"def {node.name}({ast.unparse(node.args)}){returned}"
        case ast.ClassDef():
            return f"class {node.name}({', '.join(map(ast.unparse, node.bases))})"
    return "(module)"


def _logs(root: Path) -> list[str]:
    logs = []
    for source in in_folder(root):
        for node in source.nodes:
            if not isinstance(node, ast.Raise | ast.Call):
                continue
            called = getattr(node, "func", None)
            named = isinstance(node, ast.Raise) or getattr(called, "attr", getattr(called, "id", "")) in LOGS
            if named and any(printed(list(ast.walk(node)))):
                logs.append(f"{source.path}:{node.lineno}\n  {_shown(node)}")
    return logs


def _shown(node: ast.AST) -> str:
    """Return the text of a log call or an error; a value in it is its code in braces, or `...` if that is long."""
    match node:
        case ast.Raise(exc=ast.expr() as call):
            return _shown(call)
        case ast.Call(func=ast.Name(id="refused"), args=[where, value, valid]):
            return f"{_shown(where)} is {_shown(value)}; valid: {_shown(valid)}"
        case ast.Call(func=ast.Name(id="unknown" | "UnknownNameError"), args=[kind, name, valid, *where]):
            scope = f" in {_shown(where[0])}" if where else ""
            return f"no {_shown(kind)} {_shown(name)}{scope}; valid: {_shown(valid)}"
        case ast.Call(args=[ast.Constant(value=str(text)), *values]) if "%" in text:
            parts = map(_shown, values)
            return re.sub(r"%[+\d.]*[sdgfr]", lambda match: next(parts, match[0]), text)
        case ast.IfExp(body=body, orelse=other):
            return f"({_shown(body)}|{_shown(other)})"
        case ast.JoinedStr(values=values):
            return "".join(map(_shown, values))
        case ast.Constant(value=str(text)):
            return text
        case ast.FormattedValue(value=value):
            return _value(value)
        case ast.Call(args=args) if any(printed(list(ast.walk(node)))):
            return " ".join(map(_shown, args))
    return _value(node)


def _value(node: ast.AST) -> str:
    code = ast.unparse(node)
    texts = " ".join(text for _, text in printed(list(ast.walk(node))))
    return f"{{{code}}}" if len(code) <= MAX_CODE else texts or "..."


def _pages(root: Path) -> list[str]:
    return [path.relative_to(root).as_posix() for glob in PAGES for path in root.glob(glob)]


KINDS: dict[str, Callable[[Path], list[str]]] = {"docstrings": _docstrings, "logs": _logs, "pages": _pages}

if __name__ == "__main__":
    sys.exit(main())
