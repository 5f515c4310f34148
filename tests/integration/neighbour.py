"""Two emulated machines in separate, connected network namespaces: a laboratory and a neighbour."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

LAB, NEIGHBOUR = "10.77.0.1", "10.77.0.2"
"""Addresses of the two machines."""


class Bound(NamedTuple):
    """A socket that other machines can reach: transport, address, port, and command line of its process."""

    transport: str
    address: str
    port: int
    words: tuple[str, ...]


class Network:
    """Pair of network namespaces, made by the constructor and removed by `close`.

    Raises:
        RuntimeError: this user is not permitted to make network namespaces.
    """

    def __init__(self) -> None:
        self.lab, self.neighbour = (f"hric{os.getpid()}{side}" for side in "ln")
        self._ip(f"netns add {self.lab}")
        self._ip(f"netns add {self.neighbour}")
        self._ip(f"-n {self.lab} link add cable type veth peer name cable netns {self.neighbour}")
        for name, address in ((self.lab, LAB), (self.neighbour, NEIGHBOUR)):
            for command in (f"addr add {address}/24 dev cable", "link set cable up", "link set lo up"):
                self._ip(f"-n {name} {command}")
        # The kernel gives ports of Trigno to connections, too: one may be taken before the emulation starts.
        reserve = "echo 50040-50043 > /proc/sys/net/ipv4/ip_local_reserved_ports"
        subprocess.run(self.command(self.lab, "sh", "-c", reserve), stderr=subprocess.DEVNULL)  # /proc may be read-only

    def command(self, name: str, *words: str) -> list[str]:
        """Return the words of a command that runs on one of the machines."""
        return ["ip", "netns", "exec", name, *words]

    def listening(self) -> Iterator[Bound]:
        """Yield the listening sockets of the laboratory, and its connected UDP sockets."""
        shown = subprocess.run(self.command(self.lab, "ss", "-atunpH"), capture_output=True, text=True, check=True)
        for line in shown.stdout.splitlines():
            transport, state, _, _, local, *_ = line.split()
            if transport == "tcp" and state != "LISTEN":
                continue
            address, _, port = local.rpartition(":")
            pid = line.partition("pid=")[2].partition(",")[0]  # behind a name that may have blanks
            if not pid:  # its process ended while ss looked for it
                continue
            try:
                # Dask makes one word of all, its title, where setproctitle is installed.
                words = Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ").split()
            except OSError:  # it has ended meanwhile
                continue
            yield Bound(transport, address.strip("[]").partition("%")[0].replace("*", "::"), int(port), tuple(words))

    def close(self) -> None:
        """Remove both namespaces; all processes in them must have ended."""
        for name in (self.lab, self.neighbour):
            subprocess.run(["ip", "netns", "del", name], capture_output=True)

    @staticmethod
    def _ip(arguments: str) -> None:
        made = subprocess.run(["ip", *arguments.split()], capture_output=True, text=True)
        if made.returncode:
            raise RuntimeError(f"ip {arguments}: {made.stderr.strip()}; this test makes network namespaces, as root")
