"""Command `measure_contact`: measure one contact of an arm with the virtual device, and write the sheet of it."""

import argparse
import math
from pathlib import Path

import numpy as np

from hric_assessment.contact.area import check_area
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.measured import quantities
from hric_assessment.findings import DISCLAIMER
from hric_control.plants.contact_law import Layer
from hric_core.command import Argument, Command
from hric_core.parameters import number
from hric_human.body.regions import REGION_MODELS
from hric_measurements.contact import sheet
from hric_measurements.contact.instrument import Instrument
from hric_measurements.contact.measurement import DeviceContact
from hric_measurements.speed_map.device import HitBody
from hric_measurements.speed_map.grid import DIRECTIONS
from hric_run.definition import overrides


class MeasureContactCommand(Command):
    """Measure one contact of an arm with a virtual measuring device."""

    description = (
        "Simulate one contact of the end effector with a virtual measuring device at a place, in a direction, at a "
        "speed, and compare force, pressure and energy with the limits of a body region. -o writes the sheet as PDF, "
        f"with blank columns for a real measurement at the same place. {DISCLAIMER}"
    )
    epilog = f"overrides (only those of the arm have an effect):\n{overrides.help_text()}"

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("overrides", nargs="*", metavar="key:=value", help="simulator:=pybullet, friction:=..., ..."),
            Argument("--region", choices=REGION_MODELS, default="hand, fingers", help="body region (default: a hand)"),
            Argument(
                "--position",
                nargs=3,
                type=float,
                default=(0.5, 0.0, 0.4),
                metavar=("X", "Y", "Z"),
                help="position of the contact in the base frame [m] (default: 0.5 0.0 0.4)",
            ),
            Argument(
                "--direction",
                choices=DIRECTIONS,
                default="-z",
                help="direction of the motion in the base frame, written --direction=-z (default: -z)",
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
            Argument("--film", type=float, help="edge of a cell of the film [m] (default: no pressure)"),
            Argument("--contact-area", type=float, help="area of the contact [m^2] (default: no pressure)"),
            Argument("-o", dest="out", type=Path, metavar="PDF", help="sheet to write (default: none)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Measure the contact, print the table, and write the sheet."""
        contact = DeviceContact(
            arguments.region, _body(arguments), arguments.position, arguments.direction, arguments.speed
        )
        limits, instrument = Limits.named(), Instrument(arguments.cutoff, arguments.film, arguments.contact_area)
        approach, device = contact.measure(limits, arguments.overrides)
        raw, time = np.array(device.readings), device.time_step * np.arange(1, len(device.readings) + 1)
        force = instrument.filtered(device.readings, device.time_step)
        rows = quantities(force, device.time_step, device.energy, instrument.pressure, limits, arguments.region)
        for row in rows:
            shown = "not known" if row.value is None else f"{row.value:.4g}"
            print(f"{row.name:36} {shown:>10}  {row.result} {f'({row.note})' if row.note else ''}")
        print(DISCLAIMER)
        if arguments.out is not None:
            facts = {**contact.facts(approach), **instrument.facts(), "command": arguments.command}
            curves = {"simulated": (time, raw)} | ({} if arguments.cutoff is None else {"filtered": (time, force)})
            sheet.write(arguments.out, f"Contact with {arguments.region}", facts, rows, curves, limits.table.name)
            print(f"sheet: {arguments.out}")


def _body(arguments: argparse.Namespace) -> HitBody:
    """Check the numbers among the options, and return the device that they describe."""
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
