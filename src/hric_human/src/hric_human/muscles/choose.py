"""Which muscles: those that come with the package, or a file's."""

from pathlib import Path

from hric_control.errors import HricError, ParameterError
from hric_human.muscles.anatomy import BUILT_IN, Anatomy, load

DELFT = "delft"


def find(chosen: str, where: str) -> Anatomy:
    """The muscles of an arm.

    Args:
        chosen: `delft`, or the path of a fitted file.
        where: name of the parameter, for messages.

    Raises:
        ParameterError: there is no such file, or it is not one of these.
    """
    if chosen == DELFT:
        return load(BUILT_IN)
    try:
        return load(Path(chosen))
    except HricError as error:
        raise ParameterError(f"{where}: {error}; valid: {DELFT}, or a file of rosrun hric_human fit_muscles") from error
