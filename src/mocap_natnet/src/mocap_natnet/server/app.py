"""The command `emulated_motive`."""

from __future__ import annotations

import argparse
import logging
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from hric_control.errors import HricError, ParameterError
from mocap_natnet.codec import FIRST, LAST, parse, text
from mocap_natnet.poses import UP_AXES
from mocap_natnet.server.motive import Motive
from mocap_natnet.server.scene import Faults, Scene
from mocap_natnet.server.scene_file import DEFAULT_BODIES, load
from mocap_natnet.server.server import LOG, MotiveServer
from mocap_natnet.server.settings import TRANSPORTS, UNICAST_TO, Settings


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        prog="rosrun mocap_natnet emulated_motive",
        description="An emulated Motive that streams by NatNet to any client. Needs no ROS master.",
    )
    add = made.add_argument
    add("--scene", type=Path, metavar="FILE", help="YAML with bodies and plates (default: a body `marker` on a sinusoid of 0.1 m, 0.25 Hz along x)")
    add("--up", choices=UP_AXES, default="y", help="axis that points up in the stream (default: %(default)s)")
    add("--hide-plates", action="store_true", help="stream force plates without describing them, for clients that cannot read that")
    add("--duration", type=float, default=0.0, metavar="S", help="end after this time [s]; 0: never (default: %(default)s)")
    _add_stream(made)
    _add_faults(made)
    return made


def _add_stream(made: argparse.ArgumentParser) -> None:
    base = Settings()
    add = made.add_argument_group("stream").add_argument
    add("--bitstream", default=text(base.version), metavar="V", help=f"{text(FIRST)} to {text(LAST)} (default: %(default)s)")
    add("--rate", type=float, default=base.rate, metavar="HZ", help="frames per second (default: %(default)s)")
    add("--transport", choices=TRANSPORTS, default=base.transport, help="(default: %(default)s)")
    add("--unicast-to", choices=UNICAST_TO, default=base.unicast_to, help="where a client's frames go (default: %(default)s)")
    add("--ip", default=base.ip, help="address to listen on (default: %(default)s, this machine only)")
    add("--command-port", type=int, default=base.command_port, metavar="N", help="UDP (default: %(default)s)")
    add("--data-port", type=int, default=base.data_port, metavar="N", help="UDP (default: %(default)s)")
    add("--group", default=base.group, help="multicast group (default: %(default)s)")
    add(
        "--client-timeout",
        type=float,
        default=base.client_timeout,
        metavar="S",
        help="silence that ends unicast [s]; 0: never (default: %(default)s)",
    )


def _add_faults(made: argparse.ArgumentParser) -> None:
    base = Settings()
    add = made.add_argument_group("faults").add_argument
    add("--latency", type=float, default=base.latency, metavar="S", help="from the exposure to the sending (default: %(default)s)")
    add("--jitter", type=float, default=0.0, metavar="S", help="added to it, from 0 to this")
    add("--loss", type=float, default=0.0, metavar="SHARE", help="share of frames lost, 0 to 1")
    add("--drift", type=float, default=0.0, metavar="PPM", help="how much faster the server's clock runs")
    add("--noise", type=float, default=0.0, metavar="M", help="of positions of bodies, standard deviation per axis")
    add("--rotation-noise", type=float, default=0.0, metavar="RAD", help="of their orientations, per axis")
    add("--marker-noise", type=float, default=0.0, metavar="M", help="of each marker besides")
    add("--occlude", action="append", default=[], metavar="BEGIN:DURATION[:BODY]", help="nothing of BODY (default: of all) is seen; may be repeated")
    add("--occlusion-rate", type=float, default=0.0, metavar="HZ", help="random occlusions of all bodies per second")
    add("--occlusion-length", type=float, default=0.3, metavar="S", help="their mean duration (default: %(default)s)")
    add("--seed", type=int, default=0, metavar="N", help="of all that is random")


def occlusion(words: str) -> tuple[float, float, str]:
    """BEGIN:DURATION[:BODY]. Raises ParameterError."""
    begin, _, rest = words.partition(":")
    duration, _, body = rest.partition(":")
    try:
        return float(begin), float(duration), body
    except ValueError:
        raise ParameterError(f"--occlude is {words!r}; valid: BEGIN:DURATION or BEGIN:DURATION:BODY, e.g. 2:0.5:marker [s]") from None


def make_motive(options: argparse.Namespace) -> Motive:
    """What the arguments describe. Raises HricError."""
    faults = Faults(
        options.noise,
        options.rotation_noise,
        options.marker_noise,
        tuple(map(occlusion, options.occlude)),
        options.occlusion_rate,
        options.occlusion_length,
        options.seed,
    )
    names = ("rate", "transport", "unicast_to", "ip", "command_port", "data_port", "group", "client_timeout")
    stream = {name: getattr(options, name) for name in (*names, "latency", "jitter", "loss", "drift", "seed")}
    settings = Settings(version=parse(options.bitstream), **stream)
    described = not options.hide_plates
    scene = load(options.scene, faults, options.up, described) if options.scene else Scene(DEFAULT_BODIES, (), faults, options.up, described)
    known = {body.name for body in scene.bodies}
    for _, _, body in faults.occlusions:
        if body and body not in known:
            raise ParameterError(f"--occlude names the body {body!r}; valid: {', '.join(sorted(known))}")
    return Motive(settings, scene)


def serve(options: argparse.Namespace) -> None:
    """Run until SIGINT, SIGTERM or the end of the duration. Raises HricError."""
    if not options.duration >= 0:
        raise ParameterError(f"--duration is {options.duration}; valid: 0 or more")
    motive = make_motive(options)
    server = MotiveServer(motive)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.stop())
    settings = motive.settings
    where = f"group {settings.group}" if settings.transport == "multicast" else "unicast"
    LOG.info("bitstream %s at %g Hz, %s, commands at %s:%d", text(settings.version), settings.rate, where, settings.ip, server.command_port)
    timer = threading.Timer(options.duration, server.stop)
    timer.daemon = True
    if options.duration:
        timer.start()
    try:
        server.run()
    finally:
        timer.cancel()
        server.close()


def main(words: Sequence[str] | None = None) -> int:
    """The command. Returns its exit code."""
    given = sys.argv[1:] if words is None else words
    options = parser().parse_args([word for word in given if not word.startswith("__")])  # roslaunch adds names for rospy
    logging.basicConfig(level=logging.INFO, format="[%(levelname)s] %(message)s")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # until the server stands
    try:
        serve(options)
    except HricError as error:
        LOG.critical("%s", error)
        return 1
    except KeyboardInterrupt:
        return 0
    return 0
