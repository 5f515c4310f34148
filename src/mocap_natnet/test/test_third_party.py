"""Clients of other authors, unmodified, take the emulated Motive for a Motive."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from motive_process import free_port, motive

RATE = 240
SECONDS = 1.0
SCENE = """
bodies:
  - name: marker
    motion: {type: sinusoid, centre: [0.4, 0.1, 1.0], amplitude: [0.1, 0.05, 0.02], frequency: 0.25, rotation: [0.3, 0.2, 0.1]}
  - name: counter
    motion: {type: line, points: [[0, 0, 0, 0], [100, 100, 0, 0]]}
"""
PLATE = "plates: [{wrench: [1, 2, -700, 3, 4, 5]}]\n"


def expected(t: float) -> tuple[float, float, float]:
    """Position of the body in the stream, which has y up (x, z, -y), from the text of the scene."""
    sine = math.sin(2 * math.pi * 0.25 * t)
    return 0.4 + 0.1 * sine, 1.0 + 0.02 * sine, -(0.1 + 0.05 * sine)


def scene(folder: Path, plate: bool = False) -> list[str]:
    (folder / "scene.yaml").write_text(SCENE + (PLATE if plate else ""))
    return ["--scene", str(folder / "scene.yaml"), "--rate", str(RATE)]


def collect_natnet(ports: tuple[int, int], multicast: bool, seconds: float) -> list:
    natnet = pytest.importorskip("natnet")
    frames: list = []
    client = natnet.NatNetClient("127.0.0.1", "127.0.0.1", command_port=ports[0], data_port=ports[1], use_multicast=multicast)
    with client:
        client.on_data_frame_received_event.handlers.append(frames.append)
        descriptions: list = []
        client.on_data_description_received_event.handlers.append(descriptions.append)
        client.request_modeldef()
        end = time.monotonic() + seconds
        client.run_async()
        while time.monotonic() < end:
            time.sleep(0.05)
        client.stop_async()
    assert [body.name for body in descriptions[0].rigid_bodies] == ["marker", "counter"]
    return frames


def check_natnet(frames: list, seconds: float) -> None:
    numbers = [frame.prefix.frame_number for frame in frames]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert len(numbers) > 0.5 * RATE * seconds
    for frame in frames:
        marker, counter = frame.rigid_bodies
        assert counter.pos[0] == pytest.approx(frame.prefix.frame_number / RATE, rel=1e-6)
        assert marker.pos == pytest.approx(expected(frame.prefix.frame_number / RATE), abs=1e-6)
        assert marker.tracking_valid
        assert frame.suffix.timestamp == pytest.approx(frame.prefix.frame_number / RATE, abs=1e-9)


@pytest.mark.parametrize(
    ("version", "transport"),
    [*((version, "multicast") for version in ("3.0", "3.1", "4.0", "4.1", "4.2")), *((version, "unicast") for version in ("3.0", "4.1", "4.2"))],
)
def test_natnet_reads_every_frame(version: str, transport: str, tmp_path: Path) -> None:
    ports = free_port(), free_port()
    stream = ["--bitstream", version, "--transport", transport, "--command-port", str(ports[0]), "--data-port", str(ports[1])]
    with motive(*scene(tmp_path), *stream):
        check_natnet(collect_natnet(ports, transport == "multicast", SECONDS / 2), SECONDS / 2)


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["multicast", "unicast"])
def test_natnet_misses_nothing_in_ten_seconds(transport: str, tmp_path: Path) -> None:
    ports = free_port(), free_port()
    with motive(*scene(tmp_path), "--transport", transport, "--command-port", str(ports[0]), "--data-port", str(ports[1])):
        check_natnet(collect_natnet(ports, transport == "multicast", 10.0), 10.0)


MOTIONCAPTURE = """
import json, sys, time
import motioncapture
mocap = motioncapture.connect("optitrack", {"hostname": "127.0.0.1", "interface_ip": "127.0.0.1"})
end, rows = time.monotonic() + float(sys.argv[1]), []
while time.monotonic() < end:
    mocap.waitForNextFrame()
    rows.append({name: list(map(float, body.position)) for name, body in mocap.rigidBodies.items()})
print(json.dumps(rows))
"""


def run_motioncapture(seconds: float) -> list[dict[str, list[float]]]:
    """In a process of its own: it holds the interpreter while it waits, and waits for ever for a server that does not answer."""
    pytest.importorskip("motioncapture")
    result = subprocess.run([sys.executable, "-c", MOTIONCAPTURE, str(seconds)], capture_output=True, text=True, timeout=seconds + 20)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def ports_are_free() -> bool:
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", 1510))
        except OSError:
            return False
    return True


@pytest.mark.skipif(not ports_are_free(), reason="motioncapture has fixed ports, and 1510 is taken")
@pytest.mark.parametrize("plate", [False, True], ids=["bodies", "with a force plate"])
def test_motioncapture_reads_the_poses(plate: bool, tmp_path: Path) -> None:
    with motive(*scene(tmp_path, plate), "--bitstream", "4.1", "--transport", "multicast"):
        rows = run_motioncapture(SECONDS)
    rows = [row for row in rows if {"marker", "counter"} <= set(row)]
    assert len(rows) > 0.2 * RATE * SECONDS
    for row in rows:
        number = round(row["counter"][0] * RATE)
        assert row["marker"][:3] == pytest.approx(expected(number / RATE), abs=1e-5)
