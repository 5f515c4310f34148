"""Command `hric identify_load`: finds mass, centre of mass and inertia of a payload from two logs of a motion."""

import argparse
from pathlib import Path

import numpy as np
import yaml

from franka_hw_interface import model_check
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.load_fit import LoadFit, fit_load
from franka_hw_interface.log_signals import condition
from franka_hw_interface.model_check import ModelCheck
from hric_bags import files
from hric_bags.arguments import run_arguments
from hric_core.command import Argument, Command
from hric_experiments.check_model import csv_log, sources

SERVICE = "franka_control/set_load"
"""Name of the service that sets the payload in the control box."""


class IdentifyLoadCommand(Command):
    """Find a payload's mass, centre of mass and inertia from two logs of the same motion, with and without it.

    Errors of the arm's model, and friction, are in both logs and cancel. The experiment identify_load has a motion for
    it.
    """

    def arguments(self) -> list[Argument]:
        """Return the logs and the options of `hric identify_load`."""
        return [
            *run_arguments(f"with the payload: bag, or CSV file with a header ({csv_log.USUAL})", "LOG"),
            Argument("--empty", required=True, metavar="LOG", help="run, bag or CSV file without the payload"),
            *sources.arm_arguments("with it"),
            Argument(
                "-o",
                "--output",
                type=Path,
                default=Path("load.yaml"),
                metavar="FILE",
                help=f"request of the service {SERVICE} (default: %(default)s)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Identify the payload, print it, and write the request of the service that sets it."""
        model, loaded, name = _compared(arguments)
        _, empty, other = _compared(argparse.Namespace(**{**vars(arguments), "run": arguments.empty}))
        fit = fit_load(model, loaded, empty)
        print(_report(fit, name, other, loaded.joint_names))
        files.write_text(arguments.output, yaml.safe_dump(_request(fit), default_flow_style=None, sort_keys=False))
        print(f"payload: {arguments.output}")
        print(f'on the arm:       rosservice call /{SERVICE} "$(cat {arguments.output})"')
        centre = ", ".join(f"{value:.4f}" for value in fit.com)
        print(f"in an experiment: robot.load:='{{mass: {fit.mass:.4f}, com: [{centre}]}}'")


def _compared(arguments: argparse.Namespace) -> tuple[KdlFrankaModel, ModelCheck, str]:
    """Return the arm's model without payload and friction, its comparison with a log, and the name of the log."""
    arguments = argparse.Namespace(**{**vars(arguments), "load": None})
    source = sources.find(arguments)
    model, _, _ = sources.model(arguments, source)
    return model, model_check.check(model, source.log.joint_names, condition(source.log)), source.name


def _report(fit: LoadFit, loaded: str, empty: str, joints: tuple[str, ...]) -> str:
    lines = [
        f"{loaded}, minus {empty} (shifted by {1e3 * fit.shift:.1f} ms)",
        "payload in the flange frame (+-: standard deviation, estimated from residual and bandwidth)",
        f"  mass            {fit.mass:.4f} +- {fit.mass_deviation:.1g} kg",
    ]
    for axis, value, deviation in zip("xyz", fit.com, fit.com_deviation, strict=True):
        lines.append(f"  centre of mass  {axis} {1e3 * value:8.2f} +- {1e3 * deviation:.1g} mm")
    if fit.inertia is None or fit.inertia_deviation is None:
        lines.append("  inertia         NOT DETERMINED by this motion: written as 0")
    else:
        for row, column in zip(*np.triu_indices(3), strict=True):
            value, deviation = fit.inertia[row, column], fit.inertia_deviation[row, column]
            lines.append(f"  inertia         {'xyz'[row]}{'xyz'[column]} {value:9.5f} +- {deviation:.1g} kg m^2")
    lines.append("torque of the payload and what is left of it, RMS while the joint moves [N m]")
    lines += [
        f"  {name}  {before:7.3f}  {after:.3f}"
        for name, before, after in zip(joints, fit.rms_before, fit.rms, strict=True)
    ]
    return "\n".join(lines)


def _request(fit: LoadFit) -> dict[str, object]:
    """Return the request of the service SERVICE with the payload."""
    inertia = np.zeros((3, 3)) if fit.inertia is None else fit.inertia
    return {
        "mass": round(fit.mass, 5),
        "F_x_center_load": [round(value, 5) for value in fit.com.tolist()],
        "load_inertia": [round(value, 6) for value in inertia.ravel().tolist()],
    }
