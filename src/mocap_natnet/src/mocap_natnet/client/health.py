"""Says in words which channel is silent and what the reason may be."""

from __future__ import annotations

from typing import NamedTuple

from mocap_natnet.client.session import Session
from mocap_natnet.codec import text

OK, WARN, ERROR = 0, 1, 2
"""Levels as in diagnostic_msgs/DiagnosticStatus."""


class Health(NamedTuple):
    """A level and one sentence."""

    level: int
    text: str


def health(session: Session, server: str, now: int, trouble: str = "") -> Health:
    """How the conversation goes.

    Args:
        session: whose.
        server: address of the server, "" while it is looked for.
        now: monotonic clock [ns].
        trouble: what the sockets complain about, or "".
    """
    command_silent, data_silent = session.silent(now)
    if trouble and (command_silent or data_silent):
        return Health(ERROR, trouble)
    if session.complaint:
        return Health(ERROR, session.complaint)
    if session.info is None or command_silent:
        return Health(WARN if not data_silent else ERROR, _no_answer(session, server))
    if data_silent:
        return Health(ERROR, _no_frames(session))
    echo = session.clock.echo
    if echo is not None and not echo.synchronised:
        return Health(WARN, "frames arrive, but the server answers no echo: their times are those of their arrival")
    return Health(OK, f"bitstream {text(session.info.version)}, {session.statistics.rate(now):.0f} frames per second")


def _no_answer(session: Session, server: str) -> str:
    port = session.settings.command_port
    if not server:
        return f"command channel silent: no server answers the discovery sent to {session.settings.discovery}:{port}; name its address (server)"
    return (
        f"command channel silent: {server}:{port} does not answer; is that Motive's address, is its streaming on, "
        f"does a firewall hold back UDP port {port}?"
    )


def _no_frames(session: Session) -> str:
    route, info, refused = session.route, session.info, session.statistics.refused.copy()
    assert route is not None and info is not None
    parts = ["data channel silent: the server answers, but no frame arrives"]
    if info.multicast and not route.multicast:
        parts.append("it streams to a group while unicast is asked for: set transport to auto")
    elif info.multicast is False and not route.unicast:
        parts.append("it streams by unicast while multicast is asked for: set transport to auto")
    elif route.multicast and info.group and route.group != info.group:
        parts.append(f"it streams to group {info.group}, this client listens to {route.group}: correct or leave out the group")
    elif info.data_port and route.port != info.data_port:
        parts.append(f"it streams to port {info.data_port}, this client listens to {route.port}: correct or leave out the data port")
    elif route.multicast:
        parts.append(f"group {route.group}:{route.port}: is `local` the address of the network card that faces the server, is Motive live?")
    else:
        parts.append("is Motive live, does a firewall hold back UDP from the server?")
    if refused:
        parts.append("refused so far: " + ", ".join(f"{reason} {count}" for reason, count in sorted(refused.items())))
    return "; ".join(parts)
