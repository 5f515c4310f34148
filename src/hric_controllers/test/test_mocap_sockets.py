"""The whole way over UDP: an emulated Motive in another process, the client on its sockets, publisher, controller and
arm here, paced by the wall."""

import queue
import socket
import struct
import threading
import time

import pytest
from mocap_rig import MocapArm
from motive_process import motive
from natnet_rubbish import Rubbish
from natnet_samples import one_body_frame
from real_master import free_port

from mocap_natnet.client import ClientSettings, NatNetClient, Received
from mocap_natnet.client.client import OK
from mocap_natnet.codec import Codec
from mocap_natnet.codec.descriptions import ServerModel
from mocap_natnet.codec.types import RigidBody

pytestmark = pytest.mark.alone

PATIENCE = 30.0
"""For a busy machine [s]."""
SPOILT, AT_ONCE = 20_000, 100
CODEC = Codec((4, 1))


class WireArm(MocapArm):
    """Fed by a client on sockets, as the node feeds its publisher: through a queue.

    Args:
        ports: of the server: commands, data.
    """

    def __init__(self, ports, **changes):
        super().__init__(**changes)
        self.items: queue.SimpleQueue = queue.SimpleQueue()
        put = self.items.put
        self.client = NatNetClient(
            ClientSettings(command_port=ports[0], local="127.0.0.1"), put, put, lambda: put(None)
        )
        self.began = 0

    def robot_time(self, monotonic):
        return (monotonic - self.began) * 1e-9

    def marker_cycle(self, time_now):
        self.began = self.began or time.monotonic_ns() - round(time_now * 1e9)
        time.sleep(max(0.0, (self.began - time.monotonic_ns()) * 1e-9 + time_now))
        while not self.items.empty():
            item = self.items.get()
            if isinstance(item, Received):
                self.publisher.publish(item)
            elif isinstance(item, ServerModel):
                self.publisher.describe(item)
            else:
                self.publisher.restart()

    def until(self, condition, then=0.0):
        """Run until a condition holds, and for `then` seconds more."""
        limit = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < limit, f"waited too long; the client says: {self.client.health().text}"
            self.follow(0.05)
        if then:
            self.follow(then)

    @property
    def counted(self):
        statistics = self.client.session.statistics
        return sum(statistics.taken.values()) + sum(statistics.refused.values())


class Flood(threading.Thread):
    """Sends spoilt datagrams to both of the client's ports, no faster than it takes them, so that none is lost on the
    way; from the ports of the server, of which alone it takes any: by a raw socket, as root."""

    def __init__(self, bench, ports):
        super().__init__(daemon=True)
        self._bench, self._rubbish = bench, Rubbish((4, 1), 3)
        client = bench.client
        self._ways = [(client._frames_from, ports[1]), (ports[0], client._command.getsockname()[1])]
        self.sent, self._session = 0, bench.client.session

    def _genuine(self):
        """Return a datagram that imitates the newest frame of the stream."""
        body = RigidBody(1, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        return CODEC.encode_frame(one_body_frame(self._session._sequence or 0)._replace(bodies=(body,)))

    def run(self):
        with socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_UDP) as out:
            out.bind(("127.0.0.1", 0))
            while self.sent < SPOILT:
                before, genuine = self._bench.counted, self._genuine()
                for number in range(AT_ONCE):
                    spoilt = self._rubbish.datagram(genuine)
                    header = struct.pack("!HHHH", *self._ways[number % 2], 8 + len(spoilt), 0)  # without a checksum
                    out.sendto(header + spoilt, ("127.0.0.1", 0))
                self.sent += AT_ONCE
                limit = time.monotonic() + PATIENCE
                while self._bench.counted < before + AT_ONCE and time.monotonic() < limit:
                    time.sleep(0.001)


@pytest.fixture
def ports():
    return free_port(), free_port()


def may_spoof():
    """Return True if this process may open raw sockets."""
    try:
        socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_UDP).close()
    except PermissionError:
        return False
    return True


@pytest.mark.skipif(not may_spoof(), reason="raw sockets need root")
def test_twenty_thousand_spoilt_datagrams_on_the_wire_cause_no_jump_and_are_counted_by_reason(ports):
    words = (
        "--transport",
        "unicast",
        "--unicast-to",
        "data_port",
        "--command-port",
        str(ports[0]),
        "--data-port",
        str(ports[1]),
        "--noise",
        "1e-4",
    )
    bench = WireArm(ports)
    with motive(*words), bench.client:
        bench.until(lambda: bench.messages and bench.last_state().tracking == "following", 0.5)
        flood = Flood(bench, ports)
        flood.start()
        bench.until(lambda: not flood.is_alive())
        assert flood.sent == SPOILT and bench.counted >= SPOILT
        bench.until(lambda: bench.client.health().level == OK and bench.last_state().tracking == "following", 0.5)
    bench.check_within_limits()
    refused = bench.client.session.statistics.refused
    assert sum(refused.values()) > SPOILT / 2
    assert {"short", "length", "count", "size", "unknown message", "no frame on the data channel", "unasked"} <= set(
        refused
    )
    assert bench.publisher.tracker.validator.refused
