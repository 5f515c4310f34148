"""Benchmark cases with network protocols: control loop through libfranka, motion capture, synchronisation."""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from cases import Block
from cases.arms import timed

ROOT = Path(__file__).parents[3]
CYCLES = 5000
"""Number of control cycles in a block."""
CLIENTS = {
    "panda": """
import sys, time
from panda_py import libfranka as franka
robot, cycles = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore), int(sys.argv[2])
def callback(state, period):
    global count
    count += 1
    torques = franka.Torques([0.0] * 7)
    return franka.motion_finished(torques) if count == cycles else torques
for line in sys.stdin:
    count, begin = 0, time.perf_counter()
    robot.control(callback)
    print((time.perf_counter() - begin) / cycles, flush=True)
""",
    "fr3": """
import sys, time
import pylibfranka as franka
robot, cycles = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore), int(sys.argv[2])
for line in sys.stdin:
    begin, control = time.perf_counter(), robot.start_torque_control()
    for count in range(1, cycles + 1):
        state, period = control.readOnce()
        torques = franka.Torques([0.0] * 7)
        torques.motion_finished = count == cycles
        control.writeOnce(torques)
    del control
    print((time.perf_counter() - begin) / cycles, flush=True)
""",
}
"""Client programs that measure a torque callback of an unmodified libfranka, for each line on their input."""


@contextmanager
def fci(robot: str, words: Sequence[str] = ()) -> Iterator[Block]:
    """Measure a torque callback with the emulated arm in lock-step; `words` are arguments of `hric control_box`."""
    sys.path.insert(0, str(ROOT / "src" / "franka_sim" / "test"))
    from fci_peer import control_box

    with control_box("--robot", robot, "--real-time-factor", "0", *words) as (ip, _):
        command = [sys.executable, "-c", CLIENTS[robot], ip, str(CYCLES)]
        client = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert client.stdin is not None and client.stdout is not None

        def block() -> float:
            assert client.stdin is not None and client.stdout is not None
            print("go", file=client.stdin, flush=True)
            return float(client.stdout.readline())

        try:
            yield block
        finally:
            client.kill()
            client.communicate()


@contextmanager
def natnet_frame() -> Iterator[Block]:
    """Measure a NatNet frame of one rigid body with its markers, bitstream 4.1."""
    sys.path.insert(0, str(ROOT / "src" / "mocap_natnet" / "test"))
    from natnet_samples import one_body_frame

    from mocap_natnet.codec import Codec
    from mocap_natnet.codec.packets import split

    codec = Codec((4, 1))
    datagram = codec.encode_frame(one_body_frame())

    def run(n: int) -> None:
        for _ in range(n):
            _, end = split(datagram)
            codec.decode_frame(datagram, end)

    yield timed(run, 2000)


@contextmanager
def synchroniser() -> Iterator[Block]:
    """Measure the processor time of the synchroniser per second of a data collection at 1 kHz."""
    import rospy
    import sync_cost
    from real_master import start_roscore

    start_roscore()
    rospy.init_node("benchmark", anonymous=True, disable_signals=True)
    (variant,) = (one for one in sync_cost.variants() if one.name == f"ours, resample 1000 Hz; {sync_cost.RECORDED}")
    yield lambda: sync_cost.measure(variant, 6.0).cpu
