"""Command `hric emulated_motive`: an emulated Motive (OptiTrack) that streams a scene."""

import argparse
import logging
import math
import signal
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from hric_core.command import Argument, Command
from hric_core.errors import FailureError, ParameterError
from hric_core.geometry import UP_AXES
from hric_core.parameters import Parameter, declared
from hric_core.parameters import Settings as Declared
from hric_core.processes import run_server
from hric_core.robot_time.stream_time import Clock
from mocap_natnet.codec import FIRST, LAST, parse, text
from mocap_natnet.server.motive import Motive
from mocap_natnet.server.scene import CameraFaults, ServedScene
from mocap_natnet.server.scene_file import DEFAULT_BODIES, Live, load
from mocap_natnet.server.server import LOG, MotiveServer
from mocap_natnet.server.settings import MotiveSettings

CLOCKS = ("run", "wall")
TICK = 1.0
"""Time between two calls of `tick` [s]."""
STREAM = ("rate", "transport", "unicast_to", "ip", "command_port", "data_port", "group", "client_timeout")
FAULTS = ("latency", "jitter", "loss", "drift", "seed")
SCENE_FAULTS = ("noise", "rotation_noise", "marker_noise", "occlusion_rate", "occlusion_length", "seed")
"""Options that are parameters of `MotiveSettings`, and of the scene's `CameraFaults`."""


class LiveScene(Live, Protocol):
    """Factory of motion sources that follow the running system, in robot time."""

    run_of: Callable[[float], float | None]


class EmulatedMotiveCommand(Command):
    """Emulate a Motive (OptiTrack) that streams by NatNet to any client.

    No ROS master is needed; if one runs, the stream follows robot time.
    """

    is_node = True

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments of `hric emulated_motive`."""
        return [
            Argument(
                "--scene",
                type=Path,
                metavar="FILE",
                help="YAML with bodies and plates (default: a body `marker` on a sinusoid of 0.1 m, 0.25 Hz along x)",
            ),
            Argument(
                "--up", choices=UP_AXES, default="y", help="axis that points up in the stream (default: %(default)s)"
            ),
            Argument(
                "--hide-plates",
                action="store_true",
                help="stream force plates without describing them, for clients that cannot read the description",
            ),
            Argument(
                "--clock",
                choices=CLOCKS,
                default="run",
                help="clock of the stream; run: robot time, if a ROS master runs; wall (default: %(default)s)",
            ),
            Argument(
                "--duration",
                type=float,
                default=0.0,
                metavar="S",
                help="end after this time [s]; 0: never (default: %(default)s)",
            ),
            *_stream_arguments(),
            *_fault_arguments(),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Serve without ROS, by the wall clock; return the exit code."""
        logging.basicConfig(format="[%(levelname)s] %(message)s")
        logging.getLogger("hric").setLevel(logging.INFO)  # rospy's own logger stays as it is
        return run_server("hric emulated_motive", lambda: serve(arguments))


def _stream_arguments() -> list[Argument]:
    version = Argument(
        "--bitstream",
        group="stream",
        default=text(MotiveSettings().version),
        metavar="V",
        help=f"version of the protocol, {text(FIRST)} to {text(LAST)} (default: %(default)s)",
    )
    return [version, *_declared_arguments("stream", MotiveSettings(), STREAM)]


def _fault_arguments() -> list[Argument]:
    occlude = Argument(
        "--occlude",
        group="faults",
        action="append",
        default=[],
        metavar="BEGIN:DURATION[:BODY]",
        help="BODY (default: every body) is not visible from BEGIN [s] for DURATION [s]; may be repeated",
    )
    delays = _declared_arguments("faults", MotiveSettings(), FAULTS[:-1])
    return [*delays, *_declared_arguments("faults", CameraFaults(), SCENE_FAULTS), occlude]


def _declared_arguments(group: str, settings: Declared, names: Sequence[str]) -> list[Argument]:
    """Return options for the parameters `names`, with defaults from `settings`; group: title in --help."""
    return [_declared_argument(group, declared(type(settings))[name], name, getattr(settings, name)) for name in names]


def _declared_argument(group: str, parameter: Parameter, name: str, default: Any) -> Argument:
    choices = parameter.accepts.split(", ") if parameter.kind.startswith("`") else None
    return Argument(
        f"--{name.replace('_', '-')}",
        group=group,
        type=type(default),
        default=default,
        choices=choices,
        metavar=None if choices else (parameter.unit or parameter.kind).upper(),
        help=f"{parameter.text_with_unit} (default: %(default)s)",
    )


def occlusion(words: str) -> tuple[float, float, str]:
    """Return (begin [s], duration [s], body or "") of the text BEGIN:DURATION[:BODY]. Raises ParameterError."""
    begin, _, rest = words.partition(":")
    duration, _, body = rest.partition(":")
    try:
        return float(begin), float(duration), body
    except ValueError:
        raise ParameterError(
            f"--occlude is {words!r}; valid: BEGIN:DURATION or BEGIN:DURATION:BODY, e.g. 2:0.5:marker [s]"
        ) from None


def make_motive(options: argparse.Namespace, live: Live | None = None) -> Motive:
    """Return the emulated Motive for the arguments; live: factory of motion sources. Raises HricError."""
    values = vars(options)
    settings = MotiveSettings(version=parse(options.bitstream), **{name: values[name] for name in (*STREAM, *FAULTS)})
    occlusions = tuple(map(occlusion, options.occlude))
    faults = CameraFaults(occlusions=occlusions, **{name: values[name] for name in SCENE_FAULTS})
    described = not options.hide_plates
    scene = (
        load(options.scene, faults, options.up, described, live)
        if options.scene
        else ServedScene(DEFAULT_BODIES, (), faults, options.up, described)
    )
    known = {body.name for body in scene.bodies}
    for _, _, body in faults.occlusions:
        if body and body not in known:
            raise ParameterError(f"--occlude names the body {body!r}; valid: {', '.join(sorted(known))}")
    return Motive(settings, scene)


def serve(
    options: argparse.Namespace,
    clock: Clock | None = None,
    tick: Callable[[], None] = lambda: None,
    live: LiveScene | None = None,
    on_reached: Callable[[float | None], None] = lambda reached: None,
) -> None:
    """Run the emulated Motive until SIGINT, SIGTERM or the end of the duration.

    Args:
        options: arguments of `EmulatedMotiveCommand`.
        clock: clock of the stream; None: the wall clock.
        tick: function called once a second; if it raises HricError, the server ends.
        live: factory of sources that follow the running system; its `run_of` is set to this stream's.
        on_reached: callback with the clock time up to which all frames are sent [s].

    Raises:
        HricError: an option is not valid, the stream has stopped, or `tick` raised the error.
    """
    if not options.duration >= 0:
        raise ParameterError(f"--duration is {options.duration}; valid: 0 or more")
    motive = make_motive(options, live)
    server, stop = MotiveServer(motive, clock, on_reached), threading.Event()
    if live is not None:
        live.run_of = server.robot_time
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    settings = motive.settings
    where = f"multicast to group {settings.group}" if settings.transport == "multicast" else "unicast"
    address = f"{settings.ip}:{server.command_port}"
    version = text(settings.version)
    LOG.info("streaming bitstream %s at %g Hz by %s; commands at UDP %s", version, settings.rate, where, address)
    end = time.monotonic() + (options.duration or math.inf)
    server.start()
    try:
        while time.monotonic() < end and not stop.wait(min(TICK, max(0.0, end - time.monotonic()))):
            tick()
            if not server.running:
                raise FailureError("the emulated Motive has stopped streaming")
    finally:
        server.close()
