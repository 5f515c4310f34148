"""Replay of a run folder on a ROS master: its bag with its own clock, its robot, rviz. Called by scripts/replay."""

import signal

# Until processes are started, Ctrl-C ends the program at once without a message.
signal.signal(signal.SIGINT, signal.SIG_DFL)

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from bringup_master import DEFAULT, MasterError, call, choose, node_is_alive
from replay_arguments import parsed
from replay_run import Run, blocked, find

from hric_core.errors import FAILURE, FailureError, HricError
from hric_core.processes import INTERRUPTED_CODE, end_process, start_dependent

WORKSPACE = Path(__file__).resolve().parents[2]
VIEW = WORKSPACE / "src/hric_bringup/rviz/panda.rviz"
START_TIMEOUT, RVIZ_TIMEOUT = 20.0, 40.0
"""Timeouts for the start of a node and of rviz [s]."""
END_TIMEOUT = 3.0
"""Time for a process to end before it is killed [s]."""
BEFORE = 1.0
"""Time between announcing the topics and the first message, so that the subscribers are connected [s]."""


class Interrupted(BaseException):
    """Exception raised on Ctrl-C, SIGTERM or SIGHUP."""


class Processes:
    """Child processes of the replay, which are ended in the reverse order of their start."""

    def __init__(self) -> None:
        self._started: list[subprocess.Popen[bytes]] = []

    def start(self, *command: str, quiet: bool = False) -> subprocess.Popen[bytes]:
        """Start a process that ignores Ctrl-C in the terminal, and that the system ends if this process is killed."""
        stdin = None if sys.stdin is not None and sys.stdin.isatty() else subprocess.DEVNULL
        self._started.append(start_dependent(command, stdin=stdin, stdout=subprocess.DEVNULL if quiet else None))
        return self._started[-1]

    def close(self) -> None:
        """End all processes."""
        for process in reversed(self._started):
            end_process(process, END_TIMEOUT)


def play(run: Run, master: str, running: bool, rate: float, rviz: bool) -> int:
    """Start all processes, wait for the end of the bag, and return the exit code."""
    os.environ["ROS_MASTER_URI"] = master
    processes, before = Processes(), None
    try:
        if not running:
            core = processes.start("roscore", "-p", master.rpartition(":")[2].strip("/"), quiet=True)
            _wait("roscore", lambda: call(master, "getPid") is not None, core, START_TIMEOUT)
        before = call(master, "getParam", "/use_sim_time")
        call(master, "setParam", "/use_sim_time", True)
        _show(processes, run, master, rviz)
        bags = [str(bag) for bag in run.bags]
        print(
            f"playing {run.name}: {run.duration:.1f} s at {rate:g} times the recorded speed, {len(run.topics)} topics",
            flush=True,
        )
        options = ["--quiet", "--clock", "-d", str(BEFORE), "-r", str(rate), "--topics", *run.topics, "--bags", *bags]
        return _ended(processes.start("rosbag", "play", *options, "__name:=replay"))
    except Interrupted:
        return INTERRUPTED_CODE
    finally:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        if running:
            _restore(master, run, before)
        processes.close()


def _show(processes: Processes, run: Run, master: str, rviz: bool) -> None:
    space = run.namespace
    if run.urdf:
        call(master, "setParam", f"{space}/robot_description", run.urdf)
        if not run.has_transforms:
            name = f"{space}/robot_state_publisher"
            publisher = processes.start("rosrun", "robot_state_publisher", "robot_state_publisher", *_inside(space))
            _wait(name, lambda: node_is_alive(master, name), publisher, START_TIMEOUT)
    else:
        print("the run folder has no robot.urdf, so rviz shows no robot", flush=True)
    if rviz:
        shown = processes.start("rosrun", "rviz", "rviz", "-d", str(VIEW), *_inside(space), "__name:=rviz")
        _wait("rviz", lambda: node_is_alive(master, f"{space}/rviz"), shown, RVIZ_TIMEOUT)
        if run.urdf and f"{space}/hric/view/limits" not in run.topics:
            processes.start("rosrun", "hric_perception", "live_view", *_inside(space), "__name:=live_view")


def _inside(space: str) -> list[str]:
    """Return the remapping arguments of a node in the robot's namespace, which also contains its transforms."""
    return [f"__ns:={space or '/'}", "/tf:=tf", "/tf_static:=tf_static"]


def _wait(what: str, done: Callable[[], bool], process: subprocess.Popen[bytes], timeout: float) -> None:
    deadline = time.monotonic() + timeout
    while not done():
        if process.poll() is not None:
            raise FailureError(f"{what} ended with code {process.returncode}; its messages are above")
        if time.monotonic() > deadline:
            raise FailureError(f"{what} did not start within {timeout:g} s")
        time.sleep(0.05)


def _ended(player: subprocess.Popen[bytes]) -> int:
    while player.poll() is None:
        time.sleep(0.05)
    if player.returncode:
        raise FailureError(f"rosbag play ended with code {player.returncode}; its messages are above")
    return 0


def _restore(master: str, run: Run, use_sim_time: tuple[int, str, object] | None) -> None:
    """Restore the parameters of a master that was already running."""
    if use_sim_time is not None and use_sim_time[0] == 1:
        call(master, "setParam", "/use_sim_time", bool(use_sim_time[2]))
    else:
        call(master, "deleteParam", "/use_sim_time")
    call(master, "deleteParam", f"{run.namespace}/robot_description")


def _interrupt(*_: object) -> None:
    raise Interrupted


def main(argv: Sequence[str]) -> int:
    """Run the command and return its exit code."""
    arguments = parsed(argv)
    try:
        run = find(arguments.run, arguments.runs)
        master, running = choose(os.environ.get("ROS_MASTER_URI") or DEFAULT, f"{run.namespace}/robot")
        if running and (reason := blocked(call(master, "getSystemState"), run)):
            other = "ROS_MASTER_URI=http://localhost:11322 scripts/replay ..."
            raise FailureError(
                f"{reason} on the master {master}: its topics would be mixed with those of the replay. End it first, "
                f"or replay on another master:  {other}"
            )
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, _interrupt)
        return play(run, master, running, arguments.rate, not arguments.no_rviz and bool(os.environ.get("DISPLAY")))
    except (HricError, MasterError) as error:
        print(f"scripts/replay: {error}", file=sys.stderr)
        return getattr(error, "exit_code", FAILURE)
    except Interrupted:
        return INTERRUPTED_CODE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
