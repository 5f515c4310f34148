"""Command-line program `hric`: finds the requested command among the plugins of all packages and imports only it."""

import argparse
import os
import re
import shlex
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any
from xml.etree import ElementTree

from hric_core import plugins
from hric_core.errors import UnknownNameError
from hric_core.processes import run_command

EXIT_CODES = """\
exit codes:
  0    success; for a command that checks something: all checks passed
  1    the input was valid, but the work failed: a diverged simulation, a missing robot or master, a full disk
  2    a mistake in the input; nothing was started, no file was written
  3    finished, but a check failed: a limit or tolerance is exceeded, a bag has problems, runs failed
  4    finished, but undecided: data needed for the check are missing, or a bag is damaged
  130  ended by Ctrl-C or SIGTERM"""

SMALL_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)e[+-]?\d+", re.IGNORECASE)
"""Pattern of values such as -1e-3, which argparse takes for options unless they begin with a space."""


class Argument:
    """Argument of a `hric` command.

    Args:
        names: name of a positional argument, or names of an option.
        complete: function that returns the words for the shell's completion; other values are valid, too.
        group: title of the group in which --help shows the argument.
        settings: keyword arguments of `argparse.ArgumentParser.add_argument`.
    """

    def __init__(
        self, *names: str, complete: Callable[[], Iterable[str]] | None = None, group: str = "", **settings: Any
    ) -> None:
        self.names, self.complete, self.group, self.settings = names, complete, group, settings


class Command:
    """Base class of the commands of `hric`. A package exports a subclass as a plugin, under the command's name.

    Attributes:
        description: text above the arguments in --help; empty: the docstring of the class.
        epilog: text below the arguments in --help; a text of several lines keeps its line breaks.
        is_node: True if the command is also a ROS node; then rospy reads the words NAME:=VALUE (remappings).
    """

    description = ""
    epilog = ""
    is_node = False

    def arguments(self) -> list[Argument]:
        """Return the arguments of the command, in the order of --help."""
        return []

    def run(self, arguments: argparse.Namespace) -> int | None:
        """Execute the command.

        Args:
            arguments: parsed arguments; `arguments.command` is the complete command line.

        Returns:
            the exit code; None for 0.

        Raises:
            HricError: a mistake in the input, or a failure.
        """
        raise NotImplementedError

    def parser(self, name: str = "") -> argparse.ArgumentParser:
        """Return the argument parser of the command; `name`: name of the command after `hric`."""
        text = self.description or " ".join((self.__doc__ or "").split())
        parser = argparse.ArgumentParser(f"hric {name}", None, text, self.epilog, formatter_class=_Formatter)
        groups: dict[str, argparse._ArgumentGroup | argparse.ArgumentParser] = {"": parser}
        for argument in self.arguments():
            if argument.group not in groups:
                groups[argument.group] = parser.add_argument_group(argument.group)
            action = groups[argument.group].add_argument(*argument.names, **argument.settings)
            if argument.complete is not None:
                action.completer = partial(_offered, argument.complete)  # type: ignore[attr-defined]
        return parser


def _offered(words: Callable[[], Iterable[str]], **_: object) -> Iterable[str]:
    """Return the words that argcomplete offers for an argument."""
    return words()


class _Formatter(argparse.HelpFormatter):
    """Formatter that keeps the lines of a text with several lines, such as a table in the epilog."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n" in text else super()._fill_text(text, width, indent)


def main(words: Sequence[str] | None = None) -> int:
    """Run `hric` and return its exit code.

    Args:
        words: name of the command and its arguments; None: those of `sys.argv`.
    """
    with suppress(ValueError):  # this is not the main thread
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # temporary files are removed, as after Ctrl-C
    words = sys.argv[1:] if words is None else words
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    if {"-h", "--help"}.intersection(words[:1]):
        return run_command("hric", lambda: print(_overview()))
    if words[:1] == ["--version"]:
        return run_command("hric", lambda: print(f"hric {_version()}"))
    return run_command(f"hric {_name(words)}".strip(), lambda: perform(words))


def alias(name: str) -> int:
    """Run a command of `hric` with the arguments of this process, and return its exit code."""
    return main([name, *sys.argv[1:]])


def perform(words: Sequence[str]) -> int:
    """Run a command and return its exit code.

    Args:
        words: name of the command and its arguments.

    Raises:
        HricError: the command does not exist, its arguments are wrong, or it failed.
    """
    name = _name(words)
    if not name:
        raise UnknownNameError("command", " ".join(words[:1]), plugins.names(plugins.COMMAND))
    command = plugins.find(plugins.COMMAND, name)()
    others = [f" {word}" if SMALL_NEGATIVE.fullmatch(word) else word for word in words[len(name.split()) :]]
    if command.is_node:
        others = [word for word in others if word.startswith("-") or ":=" not in word]
    namespace = argparse.Namespace(command=shlex.join(["hric", *words]))
    return command.run(command.parser(name).parse_intermixed_args(others, namespace)) or 0


def _name(words: Sequence[str]) -> str:
    """Return the command name, one word or two, with which the words begin; empty if there is none."""
    known = plugins.names(plugins.COMMAND)
    return next((name for name in (" ".join(words[:2]), *words[:1]) if name in known), "")


def _version() -> str:
    from hric_core.resources import package_path  # the commands do not need it

    return ElementTree.parse(package_path("hric_core") / "package.xml").findtext("version", "")


def _overview() -> str:
    commands = plugins.names(plugins.COMMAND)
    lines = (f"  {name:<20}{info.description}" for name, info in sorted(commands.items()))
    return "\n".join(
        ["usage: hric COMMAND [ARGUMENT ...], hric COMMAND --help, hric --version", "", *lines, "", EXIT_CODES]
    )


def _complete() -> None:
    """Print the completions that the shell requested, and end this process."""
    import argcomplete

    line = os.environ["COMP_LINE"][: int(os.environ["COMP_POINT"])]
    words = line.split()[1 : None if line.endswith(" ") else -1]
    if name := _name(words):
        parser = plugins.find(plugins.COMMAND, name)().parser(name)
        os.environ["_ARGCOMPLETE"] = str(1 + len(name.split()))  # words of the line that are the program's name
    else:
        parser = argparse.ArgumentParser("hric")
        parser.add_argument("command", choices=[name for name in plugins.names(plugins.COMMAND) if " " not in name])
    argcomplete.autocomplete(parser)
