"""Models of arms by their files, and their anatomies. Engines are loaded by a fit only."""

import logging
from pathlib import Path
from xml.etree import ElementTree

from hric_core.errors import HricError
from hric_human.muscles.anatomy import Anatomy

LOG = logging.getLogger("hric.human.muscles")
NON_COMMERCIAL = (
    "the arm of myo-sim is Apache-2.0 by its authors, but derives from MoBL-ARMS, whose terms are non-commercial: what "
    "is fitted from it is for your own non-commercial use, and belongs into no repository."
)
"""Licence notice of a model of an installed myo-sim."""
DELFT_MENDS = (
    "das4_v4.osim and is repaired as the built-in anatomy is: insertion of 12 elements of the triceps, lines of "
    "supinator and pronator quadratus, lengths of fibres and tendons, a girdle that follows the arm; its muscles of "
    "hand and wrist are left out"
)


def terms(path: Path) -> str:
    """Return the licence notice of a model before its use; "" for the user's own models."""
    return NON_COMMERCIAL if "myo_sim" in path.resolve().parts else ""


def content(path: Path, folder: Path | None = None) -> bytes:
    """Return the content of a model's file, and of the files that a MuJoCo model includes, relative to it.

    Raises:
        HricError: one of them cannot be read.
    """
    folder = path.parent if folder is None else folder
    try:
        xml = path.read_bytes()
        included = [str(element.get("file")) for element in ElementTree.fromstring(xml).iter("include")]
    except (OSError, ElementTree.ParseError) as error:
        raise HricError(f"{path} is no model of an arm: {error}") from error
    return b"|".join([xml, *(content(folder / name, folder) for name in included)])


def fit(path: Path) -> Anatomy:
    """Return the anatomy of a model, and log its repairs.

    Raises:
        HricError: the file cannot be read, or has no arm with muscles.
    """
    from hric_human.muscles.fitting import any_arm, delft, repair  # an engine takes a second

    if path.suffix.lower() == ".xml":
        from hric_human.muscles.fitting.mujoco_model import MujocoArm

        return any_arm.fit(MujocoArm(path), path.name, terms(path))
    if repair.is_das4(path):
        LOG.warning("%s is %s", path, DELFT_MENDS)
        return delft.fit(path)
    from hric_human.muscles.fitting.opensim_model import OpenSimArm

    LOG.warning("%s is used without repairs", path)
    return any_arm.fit(OpenSimArm(path), path.name, terms(path))


def run(model: Path, output: Path) -> None:
    """Fit a model, write the file of its anatomy, and print its notice and its errors. Raises HricError."""
    LOG.addHandler(logging.StreamHandler())
    LOG.setLevel(logging.INFO)
    if not model.is_file():
        raise HricError(f"no file {model}")
    if notice := terms(model):
        LOG.warning("%s", notice)
    anatomy = fit(model)
    anatomy.save(output)
    print(anatomy.notice)
    print(errors_as_markdown(anatomy))


def errors_as_markdown(anatomy: Anatomy) -> str:
    """Return the muscles with their numbers and errors of the fit, as Markdown."""
    rows = [
        "| muscle | force N | optimal mm | tendon mm | joints | length rms mm | arm rms mm | single mm | pull worst |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, muscle in anatomy.muscles.items():
        error = anatomy.errors[name]
        pull = max(error.pull_worst.values(), default=0.0)
        numbers = 1e3 * muscle.optimal_length, 1e3 * muscle.slack_length
        errors = 1e3 * error.length_rms, 1e3 * error.arm_rms, 1e3 * error.arm_worst
        rows.append(
            f"| {name} | {muscle.max_force:.0f} | {numbers[0]:.1f} | {numbers[1]:.1f} | {len(muscle.length.joints)} | "
            + " | ".join(f"{value:.2f}" for value in (*errors, pull))
            + " |"
        )
    return "\n".join(rows)
