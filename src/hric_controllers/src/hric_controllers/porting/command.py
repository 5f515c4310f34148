"""Command `port`: lists what a ros_control or franka_ros controller uses and HRIC has, and writes a package for it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hric_controllers.porting.reading import Source, Use, read_cpp
from hric_core import plugins
from hric_core.command import Argument, Command
from hric_core.errors import NOT_GOOD, HricError

if TYPE_CHECKING:
    from hric_controllers.porting.counterparts import Counterpart

TITLES = {
    "interface": "interfaces",
    "parameter": "parameters",
    "subscriber": "topics it subscribes to",
    "publisher": "topics it publishes",
    "service": "services",
    "service client": "services it calls",
    "action": "actions",
    "live parameters": "live parameters",
    "call": "calls of handles",
    "state": "fields of the Franka state",
    "library": "classes of other libraries",
    "module": "missing modules",
}


class PortCommand(Command):
    """Show which interfaces, parameters, messages and calls of a controller HRIC has; write a package to port it in.

    The controller is one of ros_control or franka_ros in C++, or a node in Python. Its headers are read, too, if they
    are next to it or in its package's folder include. Nothing is compiled or run.
    """

    epilog = (
        "exit codes: 0 HRIC has everything that was recognised; 3 something is missing in HRIC, or its type or update()"
        " is not in the source. Parts of macros and of base classes in other packages are not recognised, and computed "
        "names are listed as expressions: compare the table with the source."
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("files", nargs="+", type=Path, metavar="FILE", help="source of the controller, .cpp, .h or .py"),
            Argument(
                "--output",
                type=Path,
                metavar="FOLDER",
                help="new folder for the package (default: only show what exists)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Read the controller, print the table and write the package."""
        from hric_controllers.porting import skeleton
        from hric_controllers.porting.counterparts import counterpart
        from hric_controllers.porting.python_source import read_python

        files, output = arguments.files, arguments.output
        if output is not None and output.exists():
            raise HricError(f"--output {output} exists; name a new folder, such as src/my_port")
        is_python = [path.suffix == ".py" for path in files]
        if any(is_python) and len(files) > 1:
            raise HricError("give one Python file, or the C++ files of one controller")
        source = read_python(files[0]) if all(is_python) else read_cpp(files)
        rows = [(use, counterpart(use)) for use in source.uses]
        print("\n".join(_table(source, rows)))
        complete = all(is_python) or "update" in source.methods
        if not complete:
            print(
                "  Its update() is not in these files, so the table lacks what it uses: give the file that has it, too."
            )
        if output is not None:
            for name, text in skeleton.files(source).items():
                (output / name).parent.mkdir(parents=True, exist_ok=True)
                (output / name).write_text(text)
            print(f"\nwritten: {output}; write the law in {output}/src/{skeleton.snake(source.name)}/law.py")
        return 0 if complete and all(here.exists for _, here in rows) else NOT_GOOD


def _table(source: Source, rows: Sequence[tuple[Use, Counterpart]]) -> Iterator[str]:
    """Yield the lines that show each use with its counterpart."""
    yield source.plugin
    if source.plugin in plugins.names(plugins.CONTROLLER):
        yield "  HRIC has a controller of this type, which takes the YAML of the source: no port is needed."
    if source.others:
        yield f"  The source also has {', '.join(source.others)}: the table contains what they use, too."
    if not rows:
        yield "  No interface, parameter, topic or call was recognised in the source."
    for kind, title in TITLES.items():
        of_kind = [(use, here) for use, here in rows if use.kind == kind]
        if of_kind:
            yield f"  {title}"
        for use, here in of_kind:
            yield f"    {'yes' if here.exists else 'NO '}  {use.name:36} {here.text:44} {use.origin}"
    missing = sum(not here.exists for _, here in rows)
    yield f"  {len(rows) - missing} of {len(rows)} exist in HRIC" + (f", {missing} do not" if missing else "")
