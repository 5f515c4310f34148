"""Command `hric film`: writes a film of a run from the replay of its report."""

import argparse
import math
import re
import sys
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image
from tqdm import tqdm

from hric_bags.arguments import run_arguments
from hric_bags.files import atomic
from hric_bags.run_folder import RunFolder
from hric_core.command import Argument, Command
from hric_core.errors import FailureError, HricError
from hric_core.parameters import number
from hric_report import html
from hric_report.film.pictures import FilmView, opened
from hric_report.html import run_data

NAME = "film.mp4"
"""Name of the film's file in the run folder, without --output."""
CODECS = {
    ".mp4": ("libx264", {"crf": "20"}, {"movflags": "faststart"}),
    ".webm": ("libvpx-vp9", {"crf": "30", "b": "0", "cpu-used": "4", "row-mt": "1"}, {}),
}
"""Codec, its options, and options of the container, by file extension; presentation programs and browsers play H.264.
"""
BT709 = 1
"""Number of the colour space BT.709 (high definition) in FFmpeg's codecs."""
SMALLEST, LARGEST = 64, 4096
"""Smallest and largest width and height of a film [px] (project default)."""
SETUP = "scripts/setup --with pictures"


class FilmCommand(Command):
    """Write a film of a run: robot, person, objects and forces, as in the replay of report.html.

    Needs no display and no ROS master. Uses Chromium and the Python package av, which `scripts/setup --with pictures`
    installs.
    """

    def arguments(self) -> list[Argument]:
        """Return the run and the options of `hric film`."""
        run, root = run_arguments("", "RUN")
        return [
            run,
            root,
            Argument(
                "--output", type=Path, metavar="FILE", help=f"file .mp4 or .webm (default: {NAME} in the run folder)"
            ),
            Argument(
                "--speed",
                type=float,
                default=1.0,
                metavar="FACTOR",
                help="speed of the film; 0.5: slow motion, 2: twice as fast (default: 1)",
            ),
            Argument("--size", type=_size, default=(1280, 720), metavar="WxH", help="size [px] (default: 1280x720)"),
            Argument("--fps", type=float, default=30.0, metavar="HZ", help="pictures per second (default: 30)"),
            Argument(
                "--from",
                type=float,
                dest="begin",
                metavar="S",
                help="robot time at which the film begins [s] (default: beginning of the run)",
            ),
            Argument(
                "--to",
                type=float,
                dest="end",
                metavar="S",
                help="robot time at which the film ends [s] (default: end of the run)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Draw all pictures, write the film and print its path."""
        speed = number(minimum=1e-3, maximum=1e3).checked(arguments.speed, "--speed")
        rate = number(minimum=1.0, maximum=120.0).checked(arguments.fps, "--fps")
        folder = RunFolder.open(arguments.run, arguments.runs)
        path = (arguments.output or folder.path / NAME).expanduser()
        if path.suffix.lower() not in CODECS or not path.parent.is_dir():
            raise HricError(f"--output is {path}; valid: a file {' or '.join(CODECS)} in an existing folder")
        check_encoder()
        data = run_data.load(folder, html.metrics_of(folder), progress=sys.stderr.isatty())
        with opened(data) as pictures:
            begin, end = _span(arguments, pictures.begin, pictures.end)
            pictures.prepare(FilmView(*arguments.size), begin, end)
            count = math.floor((end - begin) * rate / speed + 1e-6) + 1
            drawn = map(pictures.draw, (begin + k * speed / rate for k in range(count)))
            quiet = not sys.stderr.isatty()
            shown = tqdm(drawn, "film", count, leave=False, unit=" pictures", disable=quiet)
            write(path, shown, arguments.size, rate)
        print(f"film: {path} ({count} pictures, {count / rate:.2f} s)")


def check_encoder() -> None:
    """Raise HricError if the Python package that encodes films is not installed."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise FailureError(f"films need the Python package av; run {SETUP}, which installs it") from error


def write(path: Path, pictures: Iterable[Image.Image], size: tuple[int, int], rate: float) -> None:
    """Write a film; an interrupted or failed call leaves no file, or the earlier one.

    Args:
        path: file .mp4 or .webm.
        pictures: pictures.
        size: width and height of the pictures, even numbers [px].
        rate: pictures per second [Hz].

    Raises:
        HricError: the file cannot be written.
    """
    import av
    from av.video.reformatter import Colorspace

    codec, options, container_options = CODECS[path.suffix.lower()]
    per_second = Fraction(rate).limit_denominator(1001)
    with atomic(path) as new, av.open(str(new), "w", options=container_options) as container:
        stream = container.add_stream(codec, rate=per_second, options=options)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.colorspace = stream.color_primaries = stream.color_trc = BT709
        for k, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(np.asarray(picture)).reformat(
                format="yuv420p", dst_colorspace=Colorspace.ITU709
            )
            frame.pts, frame.time_base = k, 1 / per_second
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def _span(arguments: argparse.Namespace, first: float, last: float) -> tuple[float, float]:
    """Return the robot times at which the film begins and ends [s].

    Args:
        arguments: parsed command line, with --from and --to.
        first: robot time at which the replay begins [s].
        last: robot time at which the replay ends [s].
    """
    begin = first if arguments.begin is None else arguments.begin
    end = last if arguments.end is None else arguments.end
    if not first - 1e-3 <= begin < end <= last + 1e-3:
        raise HricError(
            f"--from {begin:g} --to {end:g}; valid: times from {first:.3f} to {last:.3f} s, --from before --to"
        )
    return begin, end


def _size(text: str) -> tuple[int, int]:
    """Return width and height [px] in the text of the option --size, e.g. "1280x720"."""
    match = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text.lower())
    width, height = (int(part) for part in match.groups()) if match else (0, 0)
    if any(n % 2 or not SMALLEST <= n <= LARGEST for n in (width, height)):
        raise HricError(
            f"--size is {text!r}; valid: WIDTHxHEIGHT, even numbers from {SMALLEST} to {LARGEST} px, e.g. 1280x720"
        )
    return width, height
