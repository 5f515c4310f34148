"""Exceptions of the workspace. Each message says what was wrong, where, and what would be valid."""

from collections.abc import Collection, Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches

FAILURE, MISTAKE, NOT_GOOD, NOT_KNOWN = 1, 2, 3, 4
"""Exit codes of commands and nodes.

FAILURE: the input was valid, but the work failed. MISTAKE: the input is wrong, and nothing was started.
NOT_GOOD: the work is done, but a check of its result failed. NOT_KNOWN: the result cannot be judged."""


class HricError(Exception):
    """Base of all errors of HRIC: a mistake of the user, or a request that is not possible in the present state.

    Nodes and commands print the message without a traceback.

    Attributes:
        exit_code: exit code of a command that ends with this error, MISTAKE or FAILURE.
    """

    exit_code = MISTAKE

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the message and the attributes, whatever arguments the constructor of a subclass takes."""
        return _rebuilt, (type(self), self.args), self.__dict__


def _rebuilt(kind: type[HricError], args: tuple[object, ...]) -> HricError:
    error = kind.__new__(kind)
    error.args = args
    return error


class FailureError(HricError):
    """Failure of a valid request, e.g. a missing robot, master or port, a diverged simulation, a full disk."""

    exit_code = FAILURE


def refused_by_system(error: OSError) -> FailureError:
    """Return a FailureError for an OSError, with the system's reason and, if known, the file name."""
    where = f"{error.filename}: " if error.filename else ""
    return FailureError(f"{where}{error.strerror or error}")


@contextmanager
def failing() -> Iterator[None]:
    """Set the exit code FAILURE in every HricError raised within the block, as the user's input was valid."""
    try:
        yield
    except HricError as error:
        error.exit_code = FAILURE
        raise


def listed(names: Sequence[str]) -> str:
    """Return names as a text, in quotes if one of them contains a comma."""
    return ", ".join(map(repr, names) if any("," in name for name in names) else names)


class UnknownNameError(HricError):
    """Name that does not exist; the message lists the valid names and suggests the closest one.

    Args:
        kind: kind of the name, e.g. "joint".
        name: the unknown name.
        valid: the names that exist.
        where: place in which the name was looked up, e.g. "EffortJointInterface".
    """

    def __init__(self, kind: str, name: object, valid: Iterable[str], where: str = "") -> None:
        self.kind, self.name, self.valid = kind, name, sorted(valid)
        scope = f" in {where}" if where else ""
        choices = listed(self.valid) or "none"
        hint = "".join(f" (did you mean {near}?)" for near in get_close_matches(str(name), self.valid, 1))
        super().__init__(f"no {kind} {name!r}{scope}; valid: {choices}{hint}")


def check_known(kind: str, names: Iterable[object], valid: Collection[str], where: str = "") -> None:
    """Raise UnknownNameError for the first of `names` that is not in `valid`; `kind`, `where`: see UnknownNameError."""
    for name in names:
        if not isinstance(name, Hashable) or name not in valid:
            raise UnknownNameError(kind, name, valid, where)


class ParameterError(HricError):
    """Parameter that is missing, of the wrong type or out of range; the message has its full name and valid values."""


class ParameterErrors(ParameterError):
    """Several parameter errors in one; its message has a line for each.

    Args:
        errors: single errors, or groups of them.
    """

    def __init__(self, errors: Iterable[ParameterError]) -> None:
        self.errors: list[ParameterError] = []
        for error in errors:
            self.errors += error.errors if isinstance(error, ParameterErrors) else [error]
        super().__init__("\n".join(map(str, self.errors)))


def message_about(what: str, error: HricError) -> str:
    """Return the error's message, preceded by what it is about; several mistakes follow as indented lines."""
    lines = str(error).splitlines()
    return f"{what}: {error}" if len(lines) == 1 else "\n  ".join([f"{what}: {len(lines)} mistakes", *lines])


class UnknownParameterError(UnknownNameError, ParameterError):
    """Unknown parameter, or an unknown name within the value of a parameter."""


class CommandError(HricError):
    """Robot command that cannot be executed: wrong length, not finite, wrong joints. The last command stays active."""


class ResourceConflictError(HricError):
    """Conflict of two controllers that claim the same joint or resource; the message names all three."""


class DescriptionError(HricError):
    """Unusable robot description; the message names the element."""
