"""Picture of an OpenSim model at a pose, drawn without a display; and the command `picture`."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from hric_core.command import Argument, Command
from hric_core.errors import FailureError, ParameterError
from hric_core.kept import write_whole
from urdf_to_osim.decorations import Look, load_scene
from urdf_to_osim.drawing.on_demand import install_vtk


def picture(osim: Path, png: Path, pose: Mapping[str, float] | None = None, look: Look | None = None) -> list[str]:
    """Draw a model at a pose into a PNG file, and return the mesh files that are missing in the picture.

    Args:
        osim: .osim file of the model.
        png: PNG file to write; it is written completely or not at all.
        pose: values of coordinates by name [rad or m]; other coordinates have the model's default values.
        look: settings of the picture; None: the defaults.

    Raises:
        HricError: the model cannot be read, the pose is impossible, or the picture cannot be drawn or written.
    """
    look = look or Look()
    scene = load_scene(osim, pose)
    install_vtk()
    from urdf_to_osim.drawing.drawing import draw

    image = draw(scene, look)
    try:
        write_whole(png, image)
    except OSError as error:
        raise FailureError(f"cannot write {png}: {error.strerror}") from error
    return scene.missing


class PictureCommand(Command):
    """Draw an OpenSim model at a pose into a PNG file. Needs no display."""

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        look = Look()
        view, size = [look.azimuth, look.elevation], [look.width, look.height]
        return [
            Argument("model", type=Path, help=".osim file; its meshes are in the folder Geometry/ next to it"),
            Argument("-o", "--output", type=Path, help="PNG file to write (default: the model's name with .png)"),
            Argument(
                "--pose",
                nargs="+",
                default=[],
                metavar="COORDINATE=VALUE",
                help="values of coordinates [rad or m] (default: the model's default pose)",
            ),
            Argument(
                "--view",
                nargs=2,
                type=float,
                default=view,
                metavar=("AZIMUTH", "ELEVATION"),
                help="direction of the camera from the model [deg]",
            ),
            Argument(
                "--size",
                nargs=2,
                type=int,
                default=size,
                metavar=("WIDTH", "HEIGHT"),
                help="size of the picture [pixels]",
            ),
            Argument(
                "--no-centres", dest="centres", action="store_false", help="do not draw balls at the centres of mass"
            ),
            Argument("--frames", action="store_true", help="draw the axes of every body"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Draw the model and print the name of the PNG file."""
        output = arguments.output or arguments.model.with_suffix(".png")
        (width, height), (azimuth, elevation) = arguments.size, arguments.view
        look = Look(width, height, azimuth, elevation, arguments.centres, arguments.frames)
        missing = picture(arguments.model, output, _pose(arguments.pose), look)
        for file in missing:
            print(
                f"picture: mesh {file} is left out: it is not in the folder Geometry/ next to {arguments.model}",
                file=sys.stderr,
            )
        print(output)


def _pose(words: Sequence[str]) -> dict[str, float]:
    pose = {}
    for word in words:
        name, separator, value = word.rpartition("=")
        try:
            pose[name] = float(value)
        except ValueError:
            separator = ""
        if not separator or not name:
            raise ParameterError(f"--pose {word}: it must be COORDINATE=VALUE, with a number as value [rad or m]")
    return pose
