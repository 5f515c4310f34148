"""Fit of the muscles of an arm model from its file. OpenSim or MuJoCo is imported only for a fit."""

import logging
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from hric_core.errors import HricError
from hric_human.muscles.anatomy import Anatomy

LOG = logging.getLogger("hric.human.muscles")
NON_COMMERCIAL = (
    "the arm of myo-sim is Apache-2.0 by its authors, but derives from MoBL-ARMS, whose terms are non-commercial: use "
    "muscles fitted from it non-commercially only, and do not publish them in a repository."
)
"""Licence notice for a model of the package myo-sim."""
DELFT_MENDS = (
    "das4_v4.osim and is repaired like the built-in muscles: insertion of 12 elements of the triceps, lines of action "
    "of supinator and pronator quadratus, lengths of fibres and tendons, a girdle that follows the arm; its muscles of "
    "hand and wrist are left out"
)
"""Second part of the log line about the repairs of the file das4_v4.osim."""


def terms(path: Path) -> str:
    """Return the licence notice that a model's user must know; "" for models outside the package myo-sim."""
    return NON_COMMERCIAL if "myo_sim" in path.resolve().parts else ""


def content(path: Path, folder: Path | None = None) -> bytes:
    """Return the content of a model's file, with that of all files that a MuJoCo model includes.

    Args:
        path: file of the model.
        folder: folder to which included files are relative; None: that of `path`.

    Raises:
        HricError: one of the files cannot be read.
    """
    folder = path.parent if folder is None else folder
    try:
        xml = path.read_bytes()
        included = [str(element.get("file")) for element in ElementTree.fromstring(xml).iter("include")]
    except (OSError, ElementTree.ParseError) as error:
        raise HricError(f"{path} is no model of an arm: {error}") from error
    return b"|".join([xml, *(content(folder / name, folder) for name in included)])


def fit(path: Path) -> Anatomy:
    """Fit the muscles of a model, and log how the model was repaired.

    Raises:
        HricError: the file cannot be read, or has no arm with muscles.
    """
    from hric_human.muscles.fitting import any_arm, delft, repair  # imports OpenSim, which takes a second

    if path.suffix.lower() == ".xml":
        from hric_human.muscles.fitting.mujoco_model import MujocoArm

        return any_arm.fit(MujocoArm(path), path.name, terms(path))
    if repair.is_das4(path):
        LOG.warning("%s is %s", path, DELFT_MENDS)
        return delft.fit(path)
    from hric_human.muscles.fitting.certificate import certify
    from hric_human.muscles.fitting.opensim_model import OpenSimArm

    LOG.warning("%s is used without repairs: check its muscle paths yourself", path)
    anatomy = any_arm.fit(OpenSimArm(path), path.name, terms(path))
    certificate = certify(path, anatomy)
    if certificate is not None:
        LOG.info("%s: %s", path, certificate)
    return replace(anatomy, certificate=certificate)


def run(model: Path, output: Path) -> None:
    """Fit the muscles of a model, write them to a file, and print licence notice and errors of the fit.

    Raises:
        HricError: the model cannot be read, or has no arm with muscles.
    """
    LOG.addHandler(logging.StreamHandler())
    LOG.setLevel(logging.INFO)
    if not model.is_file():
        raise HricError(f"the model cannot be read: no file {model}")
    if notice := terms(model):
        LOG.warning("%s", notice)
    anatomy = fit(model)
    anatomy.save(output)
    print(anatomy.notice)
    print(errors_as_markdown(anatomy))
    if anatomy.certificate is not None:
        print(anatomy.certificate)


def errors_as_markdown(anatomy: Anatomy) -> str:
    """Return a Markdown table of the muscles: parameters, and errors of the fit at poses that were not used for it."""
    rows = [
        "| muscle | force N | optimal mm | tendon mm | joints | length rms mm | arm rms mm | arm max mm | pull max |",
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
