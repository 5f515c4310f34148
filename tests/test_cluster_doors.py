"""A Dask scheduler and worker listen on loopback only, unless they have certificates or --insecure."""

import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts/lib"))
import dask_doors  # noqa: E402

from hric_core.errors import HricError  # noqa: E402
from hric_sweep.engines import make  # noqa: E402

OTHERS = "10.0.0.1"
"""Address of another machine in the tests."""


@pytest.fixture(autouse=True)
def names(monkeypatch: pytest.MonkeyPatch) -> None:
    """Define host names of this machine, of another one, and of both."""
    known = {"far.lab": [OTHERS], "both.lab": ["127.0.0.1", OTHERS], "near.lab": ["127.0.1.1", "::1"]}
    real = socket.getaddrinfo

    def look_up(host: str, port: object, *_: object) -> list[object]:
        return [info for one in known.get(host, [host]) for info in real(one, port)]

    monkeypatch.setattr(socket, "getaddrinfo", look_up)


@pytest.mark.parametrize(
    "words",
    [
        f"worker tcp://{OTHERS}:8786",
        "worker tcp://[fe80::1]:8786",
        "worker tcp://[::ffff:10.0.0.1]:8786",
        "worker tcp://far.lab:8786",
        "worker tcp://both.lab:8786",
        "worker tcp://0.0.0.0:8786",
        "worker tcp://0:8786",
        "worker tcp://[::]:8786",
        "worker tcp://127.0.0.1:8786 --host 0.0.0.0",
        "worker tcp://127.0.0.1:8786 --host=::",
        "worker tcp://127.0.0.1:8786 --host tcp://0.0.0.0:9000",
        "worker tcp://127.0.0.1:8786 --interface eth0",
        "worker tcp://127.0.0.1:8786 --listen-address tcp://:9000",
        "worker tcp://127.0.0.1:8786 --dashboard-address :0",
        f"worker tls://{OTHERS}:8786 --dashboard-address 0.0.0.0:8787",
        f"scheduler --host {OTHERS}",
        "scheduler --host far.lab:9000",
        "scheduler --host [::]",
        "scheduler --interface eth0",
        "scheduler --host= --port 8786",
    ],
)
def test_an_open_port_is_refused_however_it_is_spelled_but_with_insecure(words: str) -> None:
    program, *rest = words.split()
    with pytest.raises(ValueError, match=r"valid: .*--insecure"):
        dask_doors.check(program, rest)
    encrypted, arguments = dask_doors.check(program, [*rest, "--insecure"])
    assert not encrypted and "--insecure" not in arguments


@pytest.mark.parametrize(
    ("words", "listens"),
    [
        ("worker tcp://127.0.0.1:8786", ["--host", "127.0.0.1"]),
        ("worker tcp://localhost:8786", ["--host", "127.0.0.1"]),
        ("worker tcp://near.lab:8786", ["--host", "near.lab"]),
        ("worker tcp://[::1]:8786 --workers 3", ["--host", "::1"]),
        ("worker tcp://127.1:8786 --interface lo", ["--interface", "lo"]),
        ("scheduler --port 8786", ["--host", "127.0.0.1"]),
    ],
)
def test_on_loopback_no_certificate_is_needed(words: str, listens: list[str]) -> None:
    program, *rest = words.split()
    encrypted, arguments = dask_doors.check(program, rest)
    assert not encrypted and arguments[program == "worker" :][:2] == listens
    assert arguments[arguments.index("--dashboard-address") + 1] == "127.0.0.1:0"


@pytest.mark.parametrize(
    "words", [f"worker tls://{OTHERS}:8786 --tls-cert c.pem", "scheduler --host far.lab --tls-cert c.pem"]
)
def test_with_a_certificate_dask_is_to_refuse_all_else(words: str) -> None:
    program, *rest = words.split()
    encrypted, arguments = dask_doors.check(program, rest)
    assert encrypted and "--tls-cert" in arguments


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("worker", r"nothing is not the address of a scheduler; valid: tcp://HOST:PORT"),
        (f"worker {OTHERS}:8786", r"10\.0\.0\.1:8786 is not the address of a scheduler"),
        ("worker ucx://127.0.0.1:8786", r"is not the address of a scheduler"),
        ("worker tcp://127.0.0.1:8786 --workers none", r"--workers none is not possible; valid: 1 or more"),
        (f"worker tcp://{OTHERS}:8786", r"whoever reaches it can run programs as you; valid: a certificate"),
        ("scheduler --host 0.0.0.0", r"whoever reaches it can run programs as you; valid: a certificate"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(words: str, said: str) -> None:
    ended = subprocess.run(
        [str(ROOT / "scripts" / words.split()[0]), *words.split()[1:]], capture_output=True, text=True, timeout=60
    )
    assert (ended.returncode, ended.stdout, len(ended.stderr.splitlines())) == (2, "", 1)
    assert re.search(said, ended.stderr)


@pytest.mark.parametrize(
    "host", [OTHERS, "167772161", "far.lab", "both.lab", "[::ffff:10.0.0.1]", "[fe80::1]", "0.0.0.0", "0", "10.1"]
)
def test_a_sweep_refuses_a_cluster_without_certificate_off_loopback_but_with_insecure(host: str) -> None:
    with pytest.raises(HricError, match=r"whoever reaches it can run programs as you; valid: .* or --insecure"):
        make._check_reach(f"tcp://{host}:8786", False)
    make._check_reach(f"tcp://{host}:8786", True)
    make._check_reach(f"tls://{host}:8786", False)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "near.lab", "[::1]", "2130706433", "127.1"])
def test_a_sweep_takes_a_cluster_on_loopback(host: str) -> None:
    make._check_reach(f"tcp://{host}:8786", False)
