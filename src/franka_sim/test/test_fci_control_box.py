"""The command: its help, its messages, its end, its console."""

import os
import signal
import subprocess
import sys
import time

import pytest
from fci_peer import CONTROL_BOX, PATIENCE, Peer, command, control_box, log_of, wait_for_log

from franka_sim.fci.console import Console
from franka_sim.fci.device import ConstantDevice

NO_MASTER = {name: value for name, value in os.environ.items() if name != "ROS_MASTER_URI"}


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(CONTROL_BOX), *words],
        capture_output=True,
        text=True,
        timeout=60,
        env=NO_MASTER,
        check=False,
    )


def test_the_help_needs_no_master() -> None:
    done = run("--help")
    assert done.returncode == 0 and "--real-time-factor" in done.stdout and "user_stop on|off" in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("--clock", "wall", "--real-time-factor", "0"),
            "the real-time factor of the wall clock is 0.0; valid: a finite number above 0",
        ),
        (("--priority", "100"), "--priority is 100; valid: a whole number from 0 to 99"),
        (("--max-lost-packets", "-1"), "--max-lost-packets is -1; valid: a whole number of 0 or more"),
    ],
)
def test_a_wrong_argument_gives_one_line_and_an_exit_code(words: tuple[str, ...], message: str) -> None:
    done = run("--constant", *words)
    assert done.returncode == 2 and message in done.stderr and "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_address_of_another_machine_is_a_failure_of_one_line() -> None:
    done = run("--constant", "--ip", "203.0.113.1")
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "cannot listen on 203.0.113.1:1337" in done.stderr


def test_two_robots_on_two_addresses_live_beside_each_other_and_a_third_on_the_same_is_refused() -> None:
    with control_box("--constant") as (first, _), control_box("--constant", "--robot", "fr3") as (second, _):
        with Peer(first, 5) as panda, Peer(second, 10) as fr3:
            assert (len(panda.state()), len(fr3.state())) == (2373, 1377)
        done = run("--constant", "--ip", first)
        assert done.returncode == 1 and f"cannot listen on {first}:1337" in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("moving", [False, True])
def test_a_signal_ends_it_at_once(number: signal.Signals, moving: bool) -> None:
    with control_box("--constant") as (ip, process), Peer(ip) as peer:
        if moving:
            peer.response(peer.move())
            peer.until_moving()
            peer.send(command())
        process.send_signal(number)
        assert process.wait(PATIENCE) == 0
        assert "Traceback" not in log_of(process)


def test_the_console_says_what_it_does_not_know() -> None:
    with control_box("--constant", "--console") as (_, process):
        assert process.stdin is not None
        for line, message in (
            ("dance", "no console command 'dance'"),
            ("user_stop", "user_stop needs 1 values; got 0"),
            ("user_stop maybe", "'maybe'; valid: on, off"),
            ("push panda_link7 x 0 0 1", "'x' is no finite number"),
            ("push panda_link7 1 0 0 1", "push refused: this robot has a constant state"),
            ("object 0.5", "does not fit between the fingers"),
            ("user_stop on", "console: user_stop on: success"),
        ):
            process.stdin.write(line + "\n")
            process.stdin.flush()
            wait_for_log(process, message)


def test_the_robot_goes_on_when_the_console_is_closed() -> None:
    with control_box("--constant", "--console") as (ip, process):
        assert process.stdin is not None
        process.stdin.close()
        process.stdin = None
        time.sleep(0.1)
        with Peer(ip) as peer:
            peer.state()


def test_a_line_of_the_console_may_come_in_pieces() -> None:
    receive, send = os.pipe()
    ended: list[bool] = []
    device = ConstantDevice()
    console = Console({"panda": device}, receive, lambda: ended.append(True))
    pressed: list[bool] = []
    device.set_user_stop = pressed.append  # type: ignore[assignment]
    for part in (b"user_", b"stop o", b"n\nuser_stop off\nuser", b"_stop on"):
        os.write(send, part)
        console.on_input(1)
    assert pressed == [True, False]
    os.close(send)
    console.on_input(1)
    assert ended
    os.close(receive)
