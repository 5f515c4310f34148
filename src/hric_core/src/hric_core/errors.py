"""Errors of the framework. Each message says what was wrong, where, and what would be valid."""

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches

FAILURE, MISTAKE, NOT_GOOD, NOT_KNOWN = 1, 2, 3, 4
"""Exit codes of commands and nodes.

FAILURE: the input was right, but the work did not succeed. MISTAKE: the input is wrong, and nothing was started.
NOT_GOOD: the work is done, and its result is not good or not complete. NOT_KNOWN: the result cannot be judged."""


class HricError(Exception):
    """Mistake of the user, or a state that forbids the request. A node prints the message without a traceback.

    Attributes:
        exit_code: exit code of the command that it ends, MISTAKE or FAILURE.
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
    """Failure of a correct request, e.g. a missing robot, master or port, a diverged simulation, a full disk."""

    exit_code = FAILURE


def refused_by_system(error: OSError) -> FailureError:
    """Return the error for a refusal of the operating system, with its reason and file name if known."""
    where = f"{error.filename}: " if error.filename else ""
    return FailureError(f"{where}{error.strerror or error}")


@contextmanager
def failing() -> Iterator[None]:
    """Turn every HricError within into a failure, whatever its type: the user's input was accepted before."""
    try:
        yield
    except HricError as error:
        error.exit_code = FAILURE
        raise


class UnknownNameError(HricError):
    """Unknown name.

    Args:
        kind: kind of the name, e.g. "joint".
        name: the unknown name.
        valid: the names that exist.
        where: place of the look-up, e.g. "EffortJointInterface".
    """

    def __init__(self, kind: str, name: object, valid: Iterable[str], where: str = "") -> None:
        self.kind, self.name, self.valid = kind, name, sorted(valid)
        scope = f" in {where}" if where else ""
        choices = ", ".join(self.valid) if self.valid else "none"
        hint = "".join(f" (did you mean {near}?)" for near in get_close_matches(str(name), self.valid, 1))
        super().__init__(f"no {kind} {name!r}{scope}; valid: {choices}{hint}")


def check_known(kind: str, names: Iterable[object], valid: Collection[str], where: str = "") -> None:
    """Raise UnknownNameError, with its arguments, for the first name that does not exist."""
    for name in names:
        if name not in valid:
            raise UnknownNameError(kind, name, valid, where)


class ParameterError(HricError):
    """Parameter that is missing, of the wrong type or out of range; the message has its full name and valid values."""


class ParameterErrors(ParameterError):
    """Several parameter errors, a line for each.

    Args:
        errors: single errors, or groups of them.
    """

    def __init__(self, errors: Iterable[ParameterError]) -> None:
        self.errors: list[ParameterError] = []
        for error in errors:
            self.errors += error.errors if isinstance(error, ParameterErrors) else [error]
        super().__init__("\n".join(map(str, self.errors)))


def message_about(what: str, error: HricError) -> str:
    """Return the message headed by the name of its subject; several mistakes as indented lines."""
    lines = str(error).splitlines()
    return f"{what}: {error}" if len(lines) == 1 else "\n  ".join([f"{what}: {len(lines)} mistakes", *lines])


class UnknownParameterError(UnknownNameError, ParameterError):
    """Unknown parameter, or an unknown name within one."""


class CommandError(HricError):
    """Command that cannot be executed: wrong length, not finite, wrong joints. The previous command stays in force."""


class ResourceConflictError(HricError):
    """Conflict of two controllers over a resource; the message names both and the resource."""


class DescriptionError(HricError):
    """Unusable robot description; the message names the element."""
