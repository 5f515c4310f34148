"""Labels of a recording that are markers of a body."""

import re
from collections.abc import Sequence

from hric_control.errors import HricError


def marker_labels(file: str, labels: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Label by marker; labels may have the body's name before them: RSHO, subject:RSHO or body_RSHO.

    Args:
        file: for messages.
        labels: of the recording.
        names: of the body's markers.

    Raises:
        HricError: none of them is there, or those of several bodies.
    """
    found: dict[str, dict[str, str]] = {}
    for label in labels:
        name = re.split("[:_]", label)[-1]
        if name in names:
            found.setdefault(label.removesuffix(name), {})[name] = label
    if len(found) != 1:
        what = f"markers of {len(found)} bodies: {', '.join(map(repr, found))}" if found else "no marker of the body"
        raise HricError(
            f"{file} has {what}; needed are some of {', '.join(names)} of one body; it has {', '.join(labels)}"
        )
    return found.popitem()[1]
