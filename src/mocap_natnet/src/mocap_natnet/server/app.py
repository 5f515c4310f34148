"""The command `emulated_motive`."""

from __future__ import annotations

import argparse
import logging
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from hric_control.errors import HricError, ParameterError
from mocap_natnet.codec import FIRST, LAST, parse, text
from mocap_natnet.poses import UP_AXES
from mocap_natnet.server.motive import Motive
from mocap_natnet.server.scene import Faults, Scene
from mocap_natnet.server.scene_file import DEFAULT_BODIES, Live, load
from mocap_natnet.server.server import LOG, MotiveServer
from mocap_natnet.server.settings import TRANSPORTS, UNICAST_TO, Settings
from mocap_natnet.server.stream_time import Clock

CLOCKS = ("run", "wall")
TICK = 1.0
"""Between ticks [s]."""


class LiveScene(Live, Protocol):
    """Sources whose bodies move in the time of the run."""

    run_of: Callable[[float], float | None]


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        prog="rosrun mocap_natnet emulated_motive",
        description="An emulated Motive that streams by NatNet to any client. Needs no ROS master; where one is, the stream goes by the run's time.",
    )
    add = made.add_argument
    add("--scene", type=Path, metavar="FILE", help="YAML with bodies and plates (default: a body `marker` on a sinusoid of 0.1 m, 0.25 Hz along x)")
    add("--up", choices=UP_AXES, default="y", help="axis that points up in the stream (default: %(default)s)")
    add("--hide-plates", action="store_true", help="stream force plates without describing them, for clients that cannot read that")
    add("--clock", choices=CLOCKS, default="run", help="run: stream in the time of the run where a ROS master answers; wall (default: %(default)s)")
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


def make_motive(options: argparse.Namespace, live: Live | None = None) -> Motive:
    """What the arguments describe; `live` makes sources that hear the running system. Raises HricError."""
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
    scene = load(options.scene, faults, options.up, described, live) if options.scene else Scene(DEFAULT_BODIES, (), faults, options.up, described)
    known = {body.name for body in scene.bodies}
    for _, _, body in faults.occlusions:
        if body and body not in known:
            raise ParameterError(f"--occlude names the body {body!r}; valid: {', '.join(sorted(known))}")
    return Motive(settings, scene)


def serve(options: argparse.Namespace, clock: Clock | None = None, tick: Callable[[], None] = lambda: None, live: LiveScene | None = None) -> None:
    """Run until SIGINT, SIGTERM or the end of the duration.

    Args:
        options: of `parser`.
        clock: by which the stream goes; None: the wall's.
        tick: called once a second; a HricError of it ends the server.
        live: makes sources that hear the running system, and is told how the stream's time and the clock's belong together.

    Raises:
        HricError: the options cannot be used, or `tick` says so.
    """
    if not options.duration >= 0:
        raise ParameterError(f"--duration is {options.duration}; valid: 0 or more")
    motive = make_motive(options, live)
    server = MotiveServer(motive, clock)
    if live is not None:
        live.run_of = server.run_time
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.stop())
    settings = motive.settings
    where = f"group {settings.group}" if settings.transport == "multicast" else "unicast"
    LOG.info("bitstream %s at %g Hz, %s, commands at %s:%d", text(settings.version), settings.rate, where, settings.ip, server.command_port)
    ticker = _Ticker(server, tick, options.duration or math.inf)
    try:
        server.run()
    finally:
        ticker.end()
        server.close()
    if ticker.failure is not None:
        raise ticker.failure


class _Ticker:
    """Calls `tick` each second beside the server, and ends it in time.

    Attributes:
        failure: of `tick`.
    """

    def __init__(self, server: MotiveServer, tick: Callable[[], None], duration: float) -> None:
        self._server, self._tick, self._end = server, tick, time.monotonic() + duration
        self._ended = threading.Event()
        self.failure: HricError | None = None
        threading.Thread(target=self._work, name="ticker", daemon=True).start()

    def end(self) -> None:
        """Call no more."""
        self._ended.set()

    def _work(self) -> None:
        while not self._ended.wait(min(TICK, max(0.0, self._end - time.monotonic()))):
            try:
                self._tick()
            except HricError as error:
                self.failure = error
            if self.failure is not None or time.monotonic() >= self._end:
                self._server.stop()
                return


def options_of(words: Sequence[str] | None) -> argparse.Namespace:
    """The command line, without the names that roslaunch adds for rospy."""
    given = sys.argv[1:] if words is None else words
    return parser().parse_args([word for word in given if not word.startswith("__")])


def main(words: Sequence[str] | None = None) -> int:
    """The command without ROS. Returns its exit code."""
    options = options_of(words)
    logging.basicConfig(level=logging.INFO, format="[%(levelname)s] %(message)s")
    return run(lambda: serve(options))


def run(work: Callable[[], None]) -> int:
    """Do the work; a HricError becomes one line and the exit code 1."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # until the server stands
    try:
        work()
    except HricError as error:
        LOG.critical("%s", error)
        return 1
    except KeyboardInterrupt:
        return 0
    return 0
