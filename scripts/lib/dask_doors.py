"""Check of the command line of a Dask scheduler or worker: no port may be open to other machines.

Anyone who reaches a port of Dask can run programs on that machine; so open ports need certificates or --insecure.
Prints one word per line: `plain` or `encrypted`, then the arguments for Dask. An open port is an error on stderr, with
exit code 2.
"""

import argparse
import os
import re
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "src/hric_core/src"))
from hric_core.wires import host_of, is_local, reached_by_others

ADDRESS = re.compile(r"(tcp|tls)://(\[[^\]]+\]|[^:/\[\]]+):(\d+)")
LISTENING = ("--host", "--interface", "--listen-address")
"""Options of Dask for the address on which its own protocol listens."""
LOOPBACK = "127.0.0.1"


class DoorError(ValueError):
    """Error of a port that would be open to other machines; the message names the option and the valid ones."""


def is_open(option: str, value: str) -> bool:
    """Return True if Dask, with this option, listens on addresses other than loopback."""
    if option == "--interface":
        return any(name != "lo" for name in value.split(","))
    return host_of(value) == "" or not is_local(host_of(value))


def check(program: str, words: list[str]) -> tuple[bool, list[str]]:
    """Check the arguments of a scheduler or worker; return True if Dask must encrypt, and the arguments for Dask.

    Raises:
        DoorError: a port would be open to other machines, or an argument is invalid.
        ValueError: a host does not exist.
    """
    parser = argparse.ArgumentParser(f"scripts/{program}", add_help=False, allow_abbrev=False)
    for option in (*LISTENING, "--dashboard-address"):
        parser.add_argument(option)
    parser.add_argument("--workers", default=str(os.cpu_count()))
    parser.add_argument("--insecure", action="store_true")
    peer = words[0] if program == "worker" and words else ""
    if program == "worker" and not ADDRESS.fullmatch(peer):
        raise DoorError(
            f"{peer or 'nothing'} is not the address of a scheduler; valid: tcp://HOST:PORT or tls://HOST:PORT, as "
            "scripts/scheduler prints it"
        )
    parsed, others = parser.parse_known_args(words[bool(peer) :])
    options = vars(parsed)
    if not re.fullmatch("[1-9][0-9]*", parsed.workers):
        raise DoorError(f"--workers {parsed.workers} is not possible; valid: 1 or more")
    binds = {option: value for option in LISTENING if (value := options[option[2:].replace("-", "_")]) is not None}
    pages = parsed.dashboard_address or f"{LOOPBACK}:0"
    reached = [f"{option} {value}" for option, value in binds.items() if is_open(option, value)]
    if peer and not is_local(host_of(peer)):
        reached.insert(0, peer)
    encrypted = bool(reached) and not parsed.insecure
    has_keys = not peer and any(word.startswith("--tls-") for word in others)
    if encrypted and not (peer.startswith("tls://") or has_keys):
        where = "tls://HOST:PORT with " * bool(peer) + "--tls-ca-file, --tls-cert, --tls-key"
        raise DoorError(reached_by_others(reached[0], where))
    if not parsed.insecure and is_open("--dashboard-address", pages):
        raise DoorError(f"--dashboard-address {pages} is open to other machines; valid: {LOOPBACK}:PORT, or --insecure")
    if not binds and not reached:
        binds["--host"] = host_of(peer) if peer and host_of(peer) != "localhost" else LOOPBACK
    arguments = [peer] * bool(peer) + [word for option, value in binds.items() for word in (option, value)]
    if program == "worker":  # the runs execute in child processes of the workers, with their own memory limit
        arguments += ["--nworkers", parsed.workers, "--nthreads", "1", "--memory-limit", "0"]
    return encrypted, [*arguments, "--dashboard-address", pages, *others]


if __name__ == "__main__":
    try:
        secret, command = check(sys.argv[1], sys.argv[2:])
    except ValueError as problem:
        print(f"scripts/{sys.argv[1]}: {problem}", file=sys.stderr)
        sys.exit(2)
    print("\n".join(["encrypted" if secret else "plain", *command]))
