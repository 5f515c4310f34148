"""Check of imports between packages by import-linter, with the contracts in pyproject.toml: python3 -m house.imports.

Executables (`src/PACKAGE/nodes/NAME`, programs of scripts) are not modules. They are copied into a temporary package as
`executables.PACKAGE.NAME`, so that the contracts apply to them, too.
"""

import logging
import re
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from house.sources import WORKSPACE, HouseError, in_folder

EXECUTABLES = "executables"
"""Name of the temporary package with the copies of executables."""
CONFIG = "pyproject.toml"


def main(root: Path = WORKSPACE) -> int:
    """Check the import contracts of a workspace, print violations, and return the exit code.

    Raises:
        HouseError: a package is not in `root_packages` of the contracts, or it or its executables are in no layer.
    """
    from importlinter.cli import lint_imports  # imported here, since scripts/count must run without pinned packages

    with _on_the_path(root) as executables:
        packages = _packages(root)
        config = tomllib.loads((root / CONFIG).read_text())["tool"]["importlinter"]
        layers = {name for layer in config["contracts"][0]["layers"] for name in re.split(r" *[:|] *", layer)}
        for names, listed in ((packages, config["root_packages"]), (packages - {EXECUTABLES} | executables, layers)):
            if wrong := sorted(names ^ set(listed)):
                raise HouseError(f"{CONFIG}, [tool.importlinter]: {', '.join(wrong)} is not listed, or not there")
        with _enabled_loggers():
            return int(lint_imports(str(root / CONFIG), no_cache=True, no_logo=True))


@contextmanager
def _enabled_loggers() -> Iterator[None]:
    """Enable loggers again afterwards: import-linter disables all loggers except its own when it configures logging."""
    loggers = [logger for logger in logging.root.manager.loggerDict.values() if isinstance(logger, logging.Logger)]
    enabled = [logger for logger in loggers if not logger.disabled]
    yield
    for logger in enabled:
        logger.disabled = False


def graph(root: Path = WORKSPACE) -> Mapping[str, frozenset[str]]:
    """Return the packages that each Python package and its executables import, by name; scripts are left out."""
    import grimp

    with _on_the_path(root):
        packages = _packages(root)
        graph = grimp.build_graph(*sorted(packages), cache_dir=None)
    edges: dict[str, set[str]] = {}
    for module in graph.modules:
        others = {_package(other) for other in graph.find_modules_directly_imported_by(module)}
        edges.setdefault(_package(module), set()).update(others)
    return {name: frozenset(others - {name}) for name, others in edges.items() if name not in ("scripts", EXECUTABLES)}


def _package(module: str) -> str:
    parts = module.split(".")
    return parts[1] if parts[0] == EXECUTABLES and len(parts) > 1 else parts[0]


def _packages(root: Path) -> set[str]:
    return {path.parent.name for path in root.glob("src/*/src")} | {EXECUTABLES}


@contextmanager
def _on_the_path(root: Path) -> Iterator[set[str]]:
    """Put the sources and copies of the executables first in sys.path; yield the packages that have such copies."""
    before, packages = sys.path[:], _packages(root)
    # Forget imported packages; otherwise the linter would search them where they were imported from, such as devel.
    loaded = {name: sys.modules.pop(name) for name in [*sys.modules] if name.partition(".")[0] in packages}
    executables: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        for source in in_folder(root):
            if "/src/" not in source.path.removeprefix("src/"):
                copy = Path(folder, EXECUTABLES, source.package, Path(source.path).stem + ".py")
                copy.parent.mkdir(parents=True, exist_ok=True)
                executables.add(f"{EXECUTABLES}.{source.package}")
                copy.write_text(source.text)
                for package in (copy.parent, copy.parent.parent):
                    (package / "__init__.py").touch()
        sys.path[:0] = [folder, *(str(path) for path in sorted(root.glob("src/*/src")))]
        try:
            yield executables
        finally:
            sys.path[:] = before
            sys.modules.update(loaded)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except HouseError as error:
        sys.exit(str(error))
