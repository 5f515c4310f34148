"""Unmodified clients of other authors accept the emulated Motive as a Motive."""

import json
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import pytest
from real_master import free_port
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent))
from motive_process import motive

pytestmark = pytest.mark.alone

RATE = 240
PATIENCE = 20.0
"""Time-out of waiting, for a busy machine [s]."""
SCENE = """
bodies:
  - name: marker
    motion: {type: sinusoid, centre: [0.4, 0.1, 1.0], amplitude: [0.1, 0.05, 0.02], frequency: 0.25, rotation: [0.3, 0.2, 0.1]}
  - name: counter
    motion: {type: line, points: [[0, 0, 0, 0], [100, 100, 0, 0]]}
"""  # noqa: E501
PLATE = "plates: [{wrench: [1, 2, -700, 3, 4, 5]}]\n"


def expected(t: float) -> tuple[float, float, float]:
    """Return the body's position in the stream, which has y up (x, z, -y), from the text of the scene."""
    sine = math.sin(2 * math.pi * 0.25 * t)
    return 0.4 + 0.1 * sine, 1.0 + 0.02 * sine, -(0.1 + 0.05 * sine)


def expected_turn(t: float) -> tuple[float, float, float, float]:
    """Return the body's orientation x, y, z, w, whose vector part is in the axes of the stream."""
    sine = math.sin(2 * math.pi * 0.25 * t)
    x, y, z, w = Rotation.from_rotvec([0.3 * sine, 0.2 * sine, 0.1 * sine]).as_quat()
    return x, z, -y, w


def angle(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the angle between two orientations [rad]; the sign of a quaternion has no meaning."""
    return float((Rotation.from_quat(a) * Rotation.from_quat(b).inv()).magnitude())


def scene(folder: Path, plate: bool = False) -> list[str]:
    (folder / "scene.yaml").write_text(SCENE + (PLATE if plate else ""))
    return ["--scene", str(folder / "scene.yaml"), "--rate", str(RATE)]


def collect_natnet(ports: tuple[int, int], multicast: bool, seconds: float) -> list:
    natnet = pytest.importorskip("natnet")
    frames: list = []
    client = natnet.NatNetClient(
        "127.0.0.1", "127.0.0.1", command_port=ports[0], data_port=ports[1], use_multicast=multicast
    )
    with client:
        client.on_data_frame_received_event.handlers.append(frames.append)
        descriptions: list = []
        client.on_data_description_received_event.handlers.append(descriptions.append)
        client.request_modeldef()
        limit = time.monotonic() + seconds + PATIENCE
        client.run_async()
        while time.monotonic() < limit and not (descriptions and len(frames) >= seconds * RATE):
            time.sleep(0.05)
        client.stop_async()
    assert [body.name for body in descriptions[0].rigid_bodies] == ["marker", "counter"]
    return frames


def check_natnet(frames: list, seconds: float) -> None:
    numbers = [frame.prefix.frame_number for frame in frames]
    assert len(numbers) >= RATE * seconds
    for frame in frames:
        marker, counter = frame.rigid_bodies
        assert counter.pos[0] == pytest.approx(frame.prefix.frame_number / RATE, rel=1e-6)
        assert marker.pos == pytest.approx(expected(frame.prefix.frame_number / RATE), abs=1e-5)
        assert angle(marker.rot, expected_turn(frame.prefix.frame_number / RATE)) < 1e-5
        assert marker.tracking_valid
        since_first = (frame.prefix.frame_number - numbers[0]) / RATE
        assert frame.suffix.timestamp - frames[0].suffix.timestamp == pytest.approx(since_first, abs=1e-6)


each_version = pytest.mark.parametrize("version", ["3.0", "3.1", "4.0", "4.1", "4.2"])
each_transport = pytest.mark.parametrize("transport", ["multicast", "unicast"])


@each_version
@each_transport
def test_natnet_reads_every_frame(version: str, transport: str, tmp_path: Path) -> None:
    check_stream(version, transport, 0.3, tmp_path)


@pytest.mark.live
@each_version
@each_transport
def test_natnet_misses_nothing_in_ten_seconds(version: str, transport: str, tmp_path: Path) -> None:
    check_stream(version, transport, 10.0, tmp_path)


def check_stream(version: str, transport: str, seconds: float, folder: Path) -> None:
    ports = free_port(), free_port()
    stream = [
        "--bitstream",
        version,
        "--transport",
        transport,
        "--command-port",
        str(ports[0]),
        "--data-port",
        str(ports[1]),
    ]
    with motive(*scene(folder), *stream):
        frames = collect_natnet(ports, transport == "multicast", seconds)
    assert {b.prefix.frame_number - a.prefix.frame_number for a, b in pairwise(frames)} == {1}
    check_natnet(frames, seconds)


MOTIONCAPTURE = """
import json, sys
import motioncapture
mocap = motioncapture.connect("optitrack", {"hostname": "127.0.0.1", "interface_ip": "127.0.0.1"})
rows = []
while len(rows) < int(sys.argv[1]):
    mocap.waitForNextFrame()
    bodies = mocap.rigidBodies
    rows.append({name: [*map(float, body.position), *(float(getattr(body.rotation, part)) for part in "xyzw")] for name, body in bodies.items()})
print(json.dumps(rows))
"""  # noqa: E501


def run_motioncapture(frames: int) -> list[dict[str, list[float]]]:
    """Run that client in a separate process: it blocks the interpreter, and waits for ever if the server is silent."""
    pytest.importorskip("motioncapture")
    result = subprocess.run(
        [sys.executable, "-c", MOTIONCAPTURE, str(frames)],
        capture_output=True,
        text=True,
        timeout=frames / RATE + PATIENCE,
    )
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
        rows = run_motioncapture(RATE)
    rows = [row for row in rows if {"marker", "counter"} <= set(row)]
    assert len(rows) > 0.9 * RATE
    for row in rows:
        number = round(row["counter"][0] * RATE)
        assert row["marker"][:3] == pytest.approx(expected(number / RATE), abs=1e-5)
        assert angle(row["marker"][3:], expected_turn(number / RATE)) < 1e-5
