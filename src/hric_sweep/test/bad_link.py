"""Two network namespaces with a link between them that delays each packet, loses some, and can be down.

The link is a pair of TUN devices whose packets this process passes on, so that the kernel's own TCP meets delay and
loss; it needs no queueing discipline of the kernel, but root.
"""

import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import threading
import time
from pathlib import Path

ADDRESSES = ("10.77.0.1", "10.77.0.2")
"""Addresses of the two sides of the link."""
_TUNSETIFF, _TUN_WITHOUT_HEADER, _CLONE_NEWNET = 0x400454CA, 0x1001, 0x40000000
MTU = 1500


def possible() -> bool:
    """Return True if this process may create network namespaces and TUN devices."""
    name = f"hric{os.getpid()}"
    if os.geteuid() != 0 or not Path("/dev/net/tun").exists():
        return False
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True).returncode == 0
    return made and subprocess.run(["ip", "netns", "del", name], capture_output=True).returncode == 0


class BadLink:
    """Link between two network namespaces; it is created at once, and `close` removes it.

    Args:
        delay: of each packet, each way [s].
        loss: probability that a packet is lost, each way.
        seed: of what is lost.

    Attributes:
        names: of the namespaces of both sides.
        up: False: nothing passes.
        lost: packets that were lost or met a link that was down.
        passed: packets that arrived.
    """

    def __init__(self, delay: float = 0.0, loss: float = 0.0, seed: int = 0) -> None:
        self.delay, self.loss = delay, loss
        self.up, self.lost, self.passed = True, 0, 0
        self._random, self._going = random.Random(seed), True
        self.names = [f"hric{os.getpid()}{side}" for side in "ab"]
        self._devices = [
            _side(name, own, other) for name, own, other in zip(self.names, ADDRESSES, ADDRESSES[::-1], strict=True)
        ]
        self._thread = threading.Thread(target=self._pass_on, daemon=True)
        self._thread.start()

    def command(self, side: int) -> list[str]:
        """Return the prefix of a command that runs it on one side of the link, 0 or 1."""
        return ["ip", "netns", "exec", self.names[side]]

    def _pass_on(self) -> None:
        waiting: list[tuple[float, int, int, bytes]] = []  # when, number, to which device, packet
        number = 0
        while self._going:
            rest = waiting[0][0] - time.monotonic() if waiting else 0.1
            for device in select.select(self._devices, [], [], min(max(rest, 0.0), 0.1))[0]:
                packet = os.read(device, MTU + 100)
                if not self.up or self._random.random() < self.loss:
                    self.lost += 1
                    continue
                other = self._devices[1 - self._devices.index(device)]
                number += 1
                heapq.heappush(waiting, (time.monotonic() + self.delay, number, other, packet))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, device, packet = heapq.heappop(waiting)
                os.write(device, packet)
                self.passed += 1

    def close(self) -> None:
        """Remove both namespaces; processes in them must have ended."""
        self._going = False
        self._thread.join()
        for device in self._devices:
            os.close(device)
        for name in self.names:
            subprocess.run(["ip", "netns", "del", name], check=True)


def _side(name: str, own: str, other: str) -> int:
    """Create a namespace with its end of the link; return the file descriptor of the device."""
    subprocess.run(["ip", "netns", "add", name], check=True)
    made: list[int] = []
    thread = threading.Thread(target=lambda: made.append(_device(name)))  # only this thread enters the namespace
    thread.start()
    thread.join()
    for command in ("link set lo up", f"addr add {own} peer {other} dev link0", f"link set link0 up mtu {MTU}"):
        subprocess.run(["ip", "-n", name, *command.split()], check=True)
    return made[0]


def _device(name: str) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    with open(f"/var/run/netns/{name}") as namespace:
        if libc.setns(namespace.fileno(), _CLONE_NEWNET) != 0:
            raise OSError(ctypes.get_errno(), "setns")
    device = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(device, _TUNSETIFF, struct.pack("16sH", b"link0", _TUN_WITHOUT_HEADER))
    return device
