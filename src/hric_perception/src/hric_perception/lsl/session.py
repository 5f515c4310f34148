"""Which streams this process sees: all of the laboratory's network, or those of this machine's session."""

from __future__ import annotations

import re

import pylsl

from hric_control.errors import ParameterError

_MACHINE = """[lab]
SessionID = {session}
KnownPeers = {{127.0.0.1}}
[multicast]
ResolveScope = machine
[log]
level = -3
"""


def use_session(session: str) -> None:
    """Call it before any other use of LSL in the process.

    Args:
        session: "": as liblsl is configured on this machine (LSLAPICFG, lsl_api.cfg; else the whole network); a name: only streams of processes on
            this machine that give the same name.

    Raises:
        ParameterError: not a name.
    """
    if not session:
        return
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,60}", session):
        raise ParameterError(f"the lsl session is {session!r}; valid: up to 60 letters, digits, _ and -, or nothing")
    pylsl.set_config_content(_MACHINE.format(session=session))
