"""Command `measure_contact`: measure one contact of an arm with the virtual device, and write the sheet of it."""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.contact.area import check_area
from hric_assessment.contact.classes import ContactClass
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.measured import quantities
from hric_assessment.findings import DISCLAIMER
from hric_control.plants.contact_law import Layer
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_core.parameters import number
from hric_human.body.regions import REGION_MODELS
from hric_run.definition import experiment, overrides
from hric_run.simulation import Simulation
from hric_sweep.measuring import sheet
from hric_sweep.measuring.instrument import Instrument
from hric_sweep.speed_map.blow import ArmBehaviour, Blows
from hric_sweep.speed_map.device import HitBody
from hric_sweep.speed_map.grid import DIRECTIONS, Postures
from hric_sweep.speed_map.measured import MapRequest

DURATION = 1.0
"""Longest time that is measured [s]: the transient half second and the quasi-static one after it."""


class MeasureContactCommand(Command):
    """Measure one contact of an arm with a virtual measuring device."""

    description = (
        "Simulate one contact of the end effector with a virtual measuring device at a place, in a direction, at a "
        "speed, and compare force, pressure and energy with the limits of a body region. -o writes the sheet as PDF, "
        f"with blank columns for a real measurement at the same place. {DISCLAIMER}"
    )
    epilog = f"overrides (only those of the arm have an effect):\n{overrides.help_text()}"

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument("overrides", nargs="*", metavar="key:=value", help="simulator:=pybullet, friction:=..., ..."),
            Argument("--region", choices=REGION_MODELS, default="hand, fingers", help="body region (default: a hand)"),
            Argument(
                "--position",
                nargs=3,
                type=float,
                default=(0.5, 0.0, 0.4),
                metavar=("X", "Y", "Z"),
                help="in the base frame [m]",
            ),
            Argument(
                "--direction",
                choices=DIRECTIONS,
                default="-z",
                help="of the motion, written --direction=-z (default: -z)",
            ),
            Argument("--speed", type=float, default=0.25, help="closing speed [m/s] (default: 0.25)"),
            Argument(
                "--clamped",
                action="store_true",
                help="fix the device to a rigid support, as a clamped body part; default: it is free to move, with the "
                "mass of the region",
            ),
            Argument("--damping", type=float, default=0.0, help="damping of the spring [N s/m] (default: 0)"),
            Argument(
                "--pad",
                nargs=3,
                type=float,
                metavar=("K", "R", "T"),
                help="pad on the spring: relaxed stiffness [N/m], relaxing stiffness [N/m], relaxation time [s]",
            ),
            Argument("--cutoff", type=float, help="cut-off frequency of the filter [Hz] (default: not filtered)"),
            Argument("--film", type=float, help="edge of a cell of the pressure film [m] (default: not known)"),
            Argument("--contact-area", type=float, help="area of the contact [m^2] (default: not known)"),
            Argument("-o", dest="out", type=Path, metavar="PDF", help="sheet to write (default: none)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Measure the contact, print the table, and write the sheet."""
        body = _body(arguments)
        limits, instrument = Limits.named(), Instrument(arguments.cutoff, arguments.film, arguments.contact_area)
        MapRequest(arguments.region, limits, arguments.damping, ArmBehaviour.DRIVEN).check()
        definition = experiment.load(experiment.NONE, ["simulator:=mujoco", *arguments.overrides])
        with Simulation(definition) as simulation:
            robot = simulation.app.hw
            if not isinstance(robot, FrankaHWSim):
                raise HricError(
                    f"the robot {definition.robot.hw} has no emulated control box; valid: franka_sim/FrankaHWSim"
                )
            point, blows = np.array(arguments.position), Blows(robot, ArmBehaviour.DRIVEN)
            if (q := Postures(robot).at(point)) is None:
                raise HricError(f"--position {point.tolist()} is out of reach; valid: a point in the arm's workspace")
            approach = blows.approach(q, np.array(DIRECTIONS[arguments.direction]))
            device, step = blows.measured(approach, body, arguments.speed, DURATION), robot.plant.time_step
        raw, time = np.array(device.readings), step * np.arange(1, len(device.readings) + 1)
        force = instrument.filtered(device.readings, step)
        rows = quantities(force, step, device.energy, instrument.pressure, limits, arguments.region)
        for row in rows:
            shown = "not known" if row.value is None else f"{row.value:.4g}"
            print(f"{row.name:36} {shown:>10}  {row.result} {f'({row.note})' if row.note else ''}")
        print(DISCLAIMER)
        if arguments.out is not None:
            facts = _facts(arguments, body, approach.mass, q.round(3).tolist())
            curves = {"simulated": (time, raw)} | ({} if arguments.cutoff is None else {"filtered": (time, force)})
            sheet.write(arguments.out, f"Contact with {arguments.region}", facts, rows, curves, limits.table.name)
            print(f"sheet: {arguments.out}")


def _body(arguments: argparse.Namespace) -> HitBody:
    """Return the device, after a check of its numbers."""
    for name in ("speed", "cutoff", "film", "contact_area"):
        if (value := getattr(arguments, name)) is not None:
            number(above=0.0).checked(value, f"--{name.replace('_', '-')}")
    number(minimum=0.0).checked(arguments.damping, "--damping")
    if arguments.cutoff is not None:
        number(maximum=499.0).checked(arguments.cutoff, "--cutoff")
    if arguments.contact_area is not None:
        check_area(arguments.contact_area, [arguments.region], "--contact-area")
    for value in arguments.pad or ():
        number(above=0.0).checked(value, "--pad")
    model = REGION_MODELS[arguments.region]
    pad = None if arguments.pad is None else Layer(*arguments.pad)
    return HitBody(math.inf if arguments.clamped else model.mass, model.stiffness, arguments.damping, pad)


def _facts(arguments: argparse.Namespace, body: HitBody, mass: float, q: list[float]) -> Mapping[str, str]:
    kind = ContactClass.CLAMPED if arguments.clamped else ContactClass.FREE
    support = "fixed to a rigid support" if arguments.clamped else f"free to move, {body.mass:g} kg"
    pad = (
        "none"
        if body.pad is None
        else f"{body.pad.stiffness:g} and {body.pad.relaxing:g} N/m, {body.pad.relaxation_time:g} s"
    )
    return {
        "body region": arguments.region,
        "class of the contact": f"{kind}: the device is {support}",
        "position": f"{' '.join(map(str, arguments.position))} m, moving along {arguments.direction}",
        "closing speed": f"{arguments.speed:g} m/s",
        "joint positions": f"{' '.join(map(str, q))} rad",
        "reflected mass of the arm": f"{mass:.2f} kg along the direction, as simulated",
        "spring of the device": f"{body.stiffness:g} N/m (ISO/TS 15066:2016), damping {body.damping:g} N s/m",
        "pad on the spring": pad,
        "filter": "none"
        if arguments.cutoff is None
        else f"low pass {arguments.cutoff:g} Hz, fourth order, no phase shift",
        "film": "not known" if arguments.film is None else f"cells of {1e3 * arguments.film:g} mm",
        "area of the contact": "not known"
        if arguments.contact_area is None
        else f"{1e4 * arguments.contact_area:g} cm^2",
        "command": arguments.command,
    }
