"""Program `hric`: one command of a package, found by its name among the plugins and imported when it is chosen."""

import argparse
import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

from hric_core import plugins
from hric_core.errors import UnknownNameError
from hric_core.processes import run_command

EXIT_CODES = """\
exit codes:
  0    done; of a command that judges: all is good
  1    the input was right, and the work failed: a diverged simulation, a missing robot or master, a full disk
  2    a mistake in the input; nothing was started, no file was written
  3    done, and not all is good: above a limit, a bag with problems, outside a tolerance, runs that failed
  4    not known: a judgement without the data it needs, a damaged bag
  130  ended by Ctrl-C"""

SMALL_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)e[+-]?\d+", re.IGNORECASE)
"""Values such as -1e-3, which argparse takes for options unless a space precedes them."""


class Argument:
    """Argument of a command.

    Args:
        names: name of a positional argument, or names of an option.
        complete: returns the words that the shell offers, where other values are possible, too.
        group: title of the group that --help shows it in.
        settings: as `argparse.ArgumentParser.add_argument` takes them.
    """

    def __init__(
        self, *names: str, complete: Callable[[], Iterable[str]] | None = None, group: str = "", **settings: Any
    ) -> None:
        self.names, self.complete, self.group, self.settings = names, complete, group, settings


class Command:
    """Command of `hric`, exported as a plugin by its name.

    Attributes:
        description: text above the arguments of --help; empty: the docstring.
        epilog: text below them; several lines are kept as they are.
        is_node: True if the command is also a ROS node, which reads the words NAME:=VALUE itself.
    """

    description = ""
    epilog = ""
    is_node = False

    def arguments(self) -> list[Argument]:
        """Return the arguments in the order of --help."""
        return []

    def run(self, arguments: argparse.Namespace) -> int | None:
        """Do the work.

        Args:
            arguments: values of the arguments; `command` is the complete command line.

        Returns:
            the exit code; None for 0.

        Raises:
            HricError: a mistake in the input, or a failure.
        """
        raise NotImplementedError

    def parser(self, name: str = "") -> argparse.ArgumentParser:
        """Return the parser of the command; name: as the user types it after `hric`."""
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
        words: command and its arguments; None: those of this process.
    """
    words = sys.argv[1:] if words is None else words
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    if {"-h", "--help"}.intersection(words[:1]):
        return run_command("hric", lambda: print(_overview()))
    return run_command(f"hric {_name(words)}".strip(), lambda: perform(words))


def alias(name: str) -> int:
    """Run a command of `hric` with the arguments of this process, and return its exit code."""
    return main([name, *sys.argv[1:]])


def perform(words: Sequence[str]) -> int:
    """Run a command and return its exit code.

    Args:
        words: command and its arguments.

    Raises:
        HricError: no such command, or an error of its work.
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
    """Return the command that the words begin with, of two words or one; empty: none."""
    known = plugins.names(plugins.COMMAND)
    return next((name for name in (" ".join(words[:2]), *words[:1]) if name in known), "")


def _overview() -> str:
    commands = plugins.names(plugins.COMMAND)
    lines = (f"  {name:<20}{info.description}" for name, info in sorted(commands.items()))
    return "\n".join(["usage: hric COMMAND [ARGUMENT ...], hric COMMAND --help", "", *lines, "", EXIT_CODES])


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
