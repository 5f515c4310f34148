"""Errors of the framework: each message says what was wrong, where, and what would be valid."""

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches

MISTAKE, FAILURE = 2, 1
"""Exit codes of commands and nodes: what was given is wrong, and nothing was begun; it was right, and did not
succeed."""


class HricError(Exception):
    """A mistake of the user or a state that forbids the request. The message is complete; a node prints it without a
    traceback.

    Attributes:
        exit_code: of the command that it ends, MISTAKE or FAILURE.
    """

    exit_code = MISTAKE

    def __reduce__(self) -> tuple[object, ...]:
        """Carry the message and the attributes to another process, whatever the constructor of a subclass takes."""
        return _rebuilt, (type(self), self.args), self.__dict__


def _rebuilt(kind: type[HricError], args: tuple[object, ...]) -> HricError:
    error = kind.__new__(kind)
    error.args = args
    return error


class FailureError(HricError):
    """What was requested correctly did not succeed: a robot, a master or a port is not there, a simulation diverged, a
    disk is full."""

    exit_code = FAILURE


def refused_by_system(error: OSError) -> FailureError:
    """Return the error for what the system refused: its reason, and the file where the system names one."""
    where = f"{error.filename}: " if error.filename else ""
    return FailureError(f"{where}{error.strerror or error}")


@contextmanager
def failing() -> Iterator[None]:
    """What goes wrong within is a failure, whatever its type: the user's words were accepted before."""
    try:
        yield
    except HricError as error:
        error.exit_code = FAILURE
        raise


class UnknownNameError(HricError):
    """A name that does not exist.

    Args:
        kind: of the name, e.g. "joint".
        name: the unknown one.
        valid: the names that exist.
        where: where it was looked up, e.g. "EffortJointInterface".
    """

    def __init__(self, kind: str, name: object, valid: Iterable[str], where: str = "") -> None:
        self.kind, self.name, self.valid = kind, name, sorted(valid)
        scope = f" in {where}" if where else ""
        choices = ", ".join(self.valid) if self.valid else "none"
        hint = "".join(f" (did you mean {near}?)" for near in get_close_matches(str(name), self.valid, 1))
        super().__init__(f"no {kind} {name!r}{scope}; valid: {choices}{hint}")


def check_known(kind: str, names: Iterable[object], valid: Collection[str], where: str = "") -> None:
    """Raises UnknownNameError, with its arguments, for the first name that does not exist."""
    for name in names:
        if name not in valid:
            raise UnknownNameError(kind, name, valid, where)


class ParameterError(HricError):
    """A parameter that is missing, of the wrong type or out of range; the message gives its full name and the valid
    values."""


class ParameterErrors(ParameterError):
    """Several of them, a line for each.

    Args:
        errors: those of parts may be several themselves.
    """

    def __init__(self, errors: Iterable[ParameterError]) -> None:
        self.errors: list[ParameterError] = []
        for error in errors:
            self.errors += error.errors if isinstance(error, ParameterErrors) else [error]
        super().__init__("\n".join(map(str, self.errors)))


def message_about(what: str, error: HricError) -> str:
    """The message with the name of what it is about; several mistakes below each other."""
    lines = str(error).splitlines()
    return f"{what}: {error}" if len(lines) == 1 else "\n  ".join([f"{what}: {len(lines)} mistakes", *lines])


class UnknownParameterError(UnknownNameError, ParameterError):
    """A parameter, or a name within one, that does not exist."""


class CommandError(HricError):
    """A command that cannot be carried out: wrong length, not finite, wrong joints. The command before it stays in
    force."""


class ResourceConflictError(HricError):
    """Two controllers want the same resource; the message names both and the resource."""


class DescriptionError(HricError):
    """A robot description that cannot be used; the message names the element."""
