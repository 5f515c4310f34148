"""Choice of the arm's muscles (anatomy): built in, a fitted file, or the user's model, fitted at its first use.

    anatomy = find("delft", "human.muscles.anatomy")
    anatomy = find("~/models/arm26.osim", "human.muscles.anatomy")     # takes a minute, later read from the cache

The cache is the folder hric/muscles in $XDG_CACHE_HOME, or in ~/.cache without it; its key is the content of the
model's file and FIT_VERSION. The folder may be removed at any time.
"""

import hashlib
import logging
from pathlib import Path

from hric_core.errors import HricError, ParameterError
from hric_core.kept import cache_folder, write_whole
from hric_core.resources import resolve
from hric_human.muscles.anatomy import BUILT_IN, Anatomy, load
from hric_human.muscles.fitting.models import content, fit, terms

LOG = logging.getLogger("hric.human.muscles")
NAME = "delft"
"""Name of the built-in anatomy."""
VALID = (
    f"{NAME} (built in), a .json file of `hric fit_muscles`, or a model of a right arm for OpenSim "
    "(.osim) or MuJoCo (.xml)"
)
FIT_VERSION = b"3"
"""Part of every key of the cache; to be changed whenever the fitting code gives another result."""


def find(chosen: str, where: str) -> Anatomy:
    """Return the built-in anatomy, or that of a file or model.

    Args:
        chosen: `delft`, or an address (path, package://, file://) of a .json file, or of an .osim or .xml model.
        where: full name of the parameter, for error messages.

    Raises:
        ParameterError: the file does not exist, is of another kind, or has no arm with muscles.
    """
    if chosen == NAME:
        return load(BUILT_IN)
    kind = Path(chosen).suffix.lower()
    if kind not in (".json", ".osim", ".xml"):
        raise ParameterError(f"{where} is {chosen!r}; valid: {VALID}")
    try:
        path = resolve(chosen)
        return load(path) if kind == ".json" else _fitted(path)
    except HricError as error:
        raise ParameterError(f"{where}: {error}. Valid: {VALID}") from error


def _fitted(path: Path) -> Anatomy:
    """Return the anatomy of a model, from the cache, or fitted now."""
    notice = terms(path)
    if notice:
        LOG.warning("%s: %s", path, notice)
    folder = cache_folder("muscles")
    parts = [FIT_VERSION, path.suffix.lower().encode(), notice.encode(), content(path)]
    key = hashlib.sha256(b"|".join(parts)).hexdigest()
    cached = None if folder is None else folder / f"{key}.json"
    if cached is not None and cached.is_file():
        try:
            return load(cached)
        except HricError as error:
            LOG.warning("the cached muscle fit of %s is damaged and is repeated: %s", path, error)
    LOG.warning("fitting the muscles of %s, which happens once and takes a minute or more", path)
    anatomy = fit(path)
    if cached is not None:
        try:
            cached.parent.mkdir(parents=True, exist_ok=True)
            write_whole(cached, anatomy.text().encode())
        except OSError as error:
            LOG.warning("the muscle fit of %s cannot be cached and will be repeated at the next use: %s", path, error)
    return anatomy
