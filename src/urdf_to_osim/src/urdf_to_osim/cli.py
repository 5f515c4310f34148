"""Command `convert`: converts a robot description to an OpenSim model and verifies it."""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from hric_core.command import Argument, Command
from hric_core.errors import DescriptionError, FailureError, ParameterError
from hric_core.parameters import declared, read_yaml
from hric_core.urdf.elements import parse
from urdf_to_osim.converter import Conversion, convert
from urdf_to_osim.options import CHOICES, Options
from urdf_to_osim.output import SUFFIX, write

if TYPE_CHECKING:
    from urdf_to_osim.proof.proof import Proof

FORWARD = 0.1
"""Simulated time of the forward simulation that ends the verification [s]."""


class ConvertCommand(Command):
    """Convert a robot description to an OpenSim 4 model, and verify it."""

    epilog = (
        "Before the model is written, the file is read back and compared with the description (the proof): frames, "
        "mass matrix, gravity and inverse dynamics with a rigid-body library; damping, friction, stops and couplers "
        "with closed-form equations. Exit code 0: written; 1: the comparison failed, nothing is written; 2: the "
        "description or an argument is refused, nothing is written."
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("input", help="robot description: .urdf, .xacro (is expanded), or - for URDF from standard input"),
            Argument(
                "-o",
                "--output",
                help=f"{SUFFIX} file to write; meshes go to the folder Geometry/ next to it (default: name of the "
                "input, in the working folder)",
            ),
            Argument(
                "--xacro-arg",
                action="append",
                default=[],
                metavar="NAME:=VALUE",
                help="argument of the xacro file; may be repeated",
            ),
            Argument("--name", default="", help="name of the model (default: the robot's)"),
            *_options_arguments(),
            Argument("--states", type=_count, default=100, help="random states of the proof (default: 100)"),
            Argument("--seed", type=int, default=0, help="seed of the proof's random numbers (default: 0)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Convert the description, verify and write the model, and print the errors found by the verification."""
        started = time.perf_counter()
        options = _options(arguments)
        urdf_xml = read_description(arguments.input, arguments.xacro_arg)
        stem = "robot" if arguments.input == "-" else Path(arguments.input).name.split(".")[0]
        output = Path(arguments.output or f"{stem}{SUFFIX}")
        conversion = convert(urdf_xml, options)
        converted = time.perf_counter()
        for note in conversion.notes:
            print(f"note: {note}")
        proofs: list[Proof] = []
        written = write(conversion, output, lambda path: proofs.append(_demand(path, urdf_xml, conversion, arguments)))
        _report(proofs[0], arguments.states)
        meshes = f", {len(written.meshes)} mesh files {written.mesh_seconds:.2f} s" if written.meshes else ""
        print(
            f"conversion {converted - started:.2f} s{meshes}, proof over {arguments.states} random states "
            f"{proofs[0].seconds:.2f} s\nwrote {written.path}"
        )


def _options_arguments() -> list[Argument]:
    """Return the command-line arguments for the options of the conversion (`Options`)."""
    return [
        _choice("up", "y", "axis of OpenSim's ground that points along z of the description (default: y)"),
        _choice("inertia", "refuse", "what to do with physically impossible inertias (default: refuse)"),
        _choice("names", "refuse", "what to do with names that OpenSim forbids (default: refuse)"),
        _choice("friction", "coulomb", "joint friction (default: coulomb, from <dynamics friction>)"),
        Argument(
            "--friction-parameters",
            metavar="YAML",
            help="file with {phi1 [N m], phi2 [s/rad], phi3 [rad/s]} by joint, for --friction sigmoid",
        ),
        *(
            Argument(f"--no-{part}", action="store_true", help=f"leave {part} out")
            for part in ("stops", "damping", "actuators", "meshes")
        ),
        Argument("--contact", action="store_true", help="add contact geometry, from the collision elements"),
        _stop("stiffness", "N m/rad"),
        _stop("damping", "N m s/rad"),
        _stop("transition", "rad"),
    ]


def _choice(name: str, default: str, text: str) -> Argument:
    return Argument(f"--{name}", choices=CHOICES[name], default=default, help=text)


def _stop(name: str, unit: str) -> Argument:
    default = declared(Options)[f"stop_{name}"].default
    text = f"{name} of the stops of revolute joints [{unit}] (default: {default:g})"
    return Argument(f"--stop-{name}", type=float, default=default, help=text)


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def _report(proof: "Proof", states: int) -> None:
    print(proof.table())
    if changes := proof.repaired:
        amounts = " and ".join(f"the {name} by {change:.1e}" for name, change in changes.items())
        print(
            f"the repair of inertias changed {amounts} (largest over {states} random states, relative to the largest "
            "value)"
        )
    if proof.forward:
        print(proof.forward.summary())


def _demand(path: Path, urdf_xml: str, conversion: Conversion, arguments: argparse.Namespace) -> "Proof":
    from urdf_to_osim.proof.proof import prove  # loads the rigid-body library, which a refusal does not need

    proof = prove(
        path, urdf_xml, conversion.options, arguments.states, arguments.seed, forward=FORWARD, conversion=conversion
    )
    if not proof.passed:
        print(proof.table())
        raise FailureError(f"the proof failed: {', '.join(proof.failed)}; nothing was written")
    return proof


def read_description(source: str, xacro_arguments: Sequence[str] = ()) -> str:
    """Return the URDF text from a URDF file, an expanded xacro file, or the standard input ("-").

    Raises:
        ParameterError: the file does not exist, or xacro arguments are given in a wrong form or without a xacro file.
        DescriptionError: the file cannot be read as a robot description.
    """
    if source != "-" and not Path(source).is_file():
        raise ParameterError(f"no file {source}")
    if source.endswith(".xacro"):
        pairs = [word.partition(":=") for word in xacro_arguments]
        for name, separator, _ in pairs:
            if not separator or not name:
                raise ParameterError(f"--xacro-arg {name!r} is not of the form NAME:=VALUE")
        from panda_description import process_xacro  # loads xacro

        return str(process_xacro(Path(source), {name: value for name, _, value in pairs}).toxml())
    if xacro_arguments:
        raise ParameterError(f"--xacro-arg needs an input that ends in .xacro; got {source}")
    try:
        content = sys.stdin.buffer.read() if source == "-" else Path(source).read_bytes()
        return ElementTree.tostring(parse(content), encoding="unicode")
    except DescriptionError as error:
        raise DescriptionError(f"{source}: {error}") from error
    except OSError as error:
        raise ParameterError(f"{source} cannot be read: {error.strerror}") from error


def _options(arguments: argparse.Namespace) -> Options:
    return Options(
        name=arguments.name,
        up=arguments.up,
        inertia=arguments.inertia,
        names=arguments.names,
        stops=not arguments.no_stops,
        stop_stiffness=arguments.stop_stiffness,
        stop_damping=arguments.stop_damping,
        stop_transition=arguments.stop_transition,
        damping=not arguments.no_damping,
        friction=arguments.friction,
        friction_parameters=_friction_parameters(arguments.friction_parameters),
        actuators=not arguments.no_actuators,
        meshes=not arguments.no_meshes,
        contact=arguments.contact,
        folder="" if arguments.input == "-" else str(Path(arguments.input).parent),
    )


def _friction_parameters(source: str | None) -> dict[str, dict[str, float]]:
    if source is None:
        return {}
    content = read_yaml(Path(source))
    if not isinstance(content, dict):
        raise ParameterError(
            f"--friction-parameters {source}: the file must map each joint to {{phi1: .., phi2: .., phi3: ..}}"
        )
    return {str(joint): phi for joint, phi in content.items()}
