"""Program of scripts/bringup: check the arguments, choose the ROS master, run bringup.launch, return its exit code."""

from bringup_end import INTERRUPTED, REQUESTS, EndAtOnce

early = EndAtOnce()

import contextlib
import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bringup_arguments as given
import rosgraph.names
import roslaunch.parent
import roslaunch.pmon
from bringup_end import end_nodes
from bringup_master import DEFAULT, MasterError, call, choose
from bringup_ready import PERIOD, arm, block, engine, namespace

from hric_bags.run_folder import RunFolder
from hric_core import yaml_text
from hric_core.errors import FAILURE, HricError
from hric_core.processes import describe_exit, end_with_parent

X11_PORT = 6000
"""TCP port of display 0 (X Window System protocol)."""
DISPLAY_TIMEOUT = 1.0
"""Timeout for a connection to a display [s] (project default, unconfirmed)."""
PROBE_TIMEOUT = 1.0
"""Timeout for a connection to the arm's control box [s]."""


class RequiredNodes(roslaunch.pmon.ProcessListener):
    """Watcher of required nodes: if one of them ends, the run ends.

    Attributes:
        required: names of the required nodes, as in process names of roslaunch.
        code: exit code of the node that ended the run.
        exit_text: name of this node and how it ended; empty during the run.
    """

    def __init__(self) -> None:
        self.required: set[str] = set()
        self.code, self.exit_text = 0, ""

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Record the end of a required node. Called by roslaunch in its thread; process names are NODE-NUMBER."""
        node = process_name.rpartition("-")[0]
        if node in self.required and not self.exit_text:
            self.code, self.exit_text = exit_code or 0, describe_exit(node, exit_code or 0)


def resolve_rviz(value: str) -> str:
    """Return the argument rviz as "true" or "false", where "auto" is "true" if a display accepts connections.

    Raises:
        given.ArgumentError: rviz:=true without a display.
    """
    if value == "false":
        return value
    display = os.environ.get("DISPLAY", "")
    shown = display_responds(display)
    if value == "true" and not shown:
        reason = f"no display accepts connections at DISPLAY={display}" if display else "DISPLAY is not set"
        raise given.ArgumentError(f"rviz:=true needs a display, and {reason}; valid: rviz:=false, or rviz:=auto")
    return str(shown).lower()


def display_responds(display: str) -> bool:
    """Return True if an X server accepts connections at "HOST:NUMBER", ":NUMBER" or "unix:NUMBER"."""
    host, _, number = display.rpartition(":")
    number = number.partition(".")[0]
    if not number.isdigit():
        return False
    path = f"{host}:{number}" if host.startswith("/") else f"/tmp/.X11-unix/X{number}"
    local = host in ("", "unix") or host.startswith("/")
    return any(map(_accepts, [path, f"\0{path}"] if local else [(host, X11_PORT + int(number))]))


def _accepts(address: Any) -> bool:
    with socket.socket(socket.AF_UNIX if isinstance(address, str) else socket.AF_INET) as connection:
        connection.settimeout(DISPLAY_TIMEOUT)
        return connection.connect_ex(address) == 0


def check_realism(value: str) -> None:
    """Raise given.ArgumentError if the simulated arm does not accept this value of the argument realism."""
    if value in given.REALISM:
        return
    from franka_sim.realism import parse  # imported late, as it loads the simulated arm

    try:
        parse(yaml_text.parse(value, "realism"), "realism")
    except HricError as error:
        raise given.ArgumentError(f"realism:={value} is not possible: {' '.join(str(error).split())}") from None


def announce(arguments: Mapping[str, str], master: str, running: bool) -> None:
    """Print the environment, experiment or controller, devices and ROS master that are about to start."""
    experiment, controller = arguments["experiment"], arguments["controller"]
    task = f"experiment {experiment}" if experiment != "none" else f"controller {controller}"
    what = arm(arguments) if arguments["env"] == "real" else engine(arguments)
    capture = "".join(f"   {name}: {arguments[name]}" for name in given.DEVICES if arguments[name] != "none")
    print(f"starting   env: {arguments['env']} ({what})   {task}{capture}   rviz: {arguments['rviz']}")
    print(f"ROS master: {master} ({'already running' if running else 'started here'})", flush=True)


class ShutdownRequest:
    """Counter of shutdown requests (Ctrl-C, SIGTERM, SIGHUP).

    The signal handlers of roslaunch would end nodes during their start and could leave one of them running. So a
    request is counted here, and handled after all nodes have started.
    """

    def __init__(self) -> None:
        self.count = 0
        for number in REQUESTS:
            signal.signal(number, self._remember)

    def _remember(self, *_: object) -> None:
        self.count += 1


def run(arguments: Mapping[str, str], master: str) -> int:
    """Run bringup.launch until a required node ends or Ctrl-C; return the exit code."""
    os.environ["ROS_MASTER_URI"] = master
    confine_roscpp()
    nodes = RequiredNodes()
    uuid = roslaunch.rlutil.get_or_generate_uuid(None, False)
    roslaunch.configure_logging(uuid)
    mappings = [f"{name}:={value}" for name, value in arguments.items()]
    parent = roslaunch.parent.ROSLaunchParent(
        uuid, [(str(given.LAUNCH), mappings)], process_listeners=[nodes], show_summary=False
    )
    try:
        parent._load_config()
        nodes.required = _take_over_required(parent.config)
        roslaunch.pmon._init_signal_handlers()
        request = ShutdownRequest()
        early.over()
        # Processes end with the thread that started them. This thread starts all processes, including the master, and
        # lives as long as this process, so that none of them remains, even if this process is killed.
        os.register_at_fork(after_in_child=end_with_parent(signal.SIGTERM))
        parent._start_infrastructure()
        parent.start()
    except roslaunch.core.RLException as error:
        print(f"scripts/bringup: {error}", file=sys.stderr)
        return 1

    def is_running(node: str) -> bool:
        return any(name.rpartition("-")[0].rpartition("/")[2] == node for name in parent.pm.get_active_names())

    _wait(parent, nodes, request, lambda: block(arguments, master, lambda name: parameter(master, name), is_running))
    space = namespace(arguments)
    folder = parameter(master, f"{space}/recorder/folder")
    if nodes.code:
        call(
            master, "setParam", f"{space}/hric/experiment/failure", nodes.exit_text
        )  # the recorder, which ends last, reads it
    end_nodes(parent.pm, lambda: request.count > 1)
    parent.shutdown()
    if isinstance(folder, str):
        close_run(folder, nodes.exit_text)
    return _code(nodes, arguments["experiment"] != "none")


def confine_roscpp() -> None:
    """Make roscpp programs that are started from here, such as rosout, listen at ROS_IP only, like rospy programs."""
    library = Path(os.environ["HRIC_WS"]) / "devel/lib/libhric_roscpp_loopback.so"
    if library.exists():
        os.environ["LD_PRELOAD"] = ":".join(filter(None, (str(library), os.environ.get("LD_PRELOAD"))))


def close_run(folder: str, reason: str) -> None:
    """Write the end of a run and its reason to the run folder, if its recorder could not."""
    with contextlib.suppress(HricError):  # the folder was removed
        RunFolder(Path(folder)).read(reason)


def parameter(master: str, name: str) -> object:
    """Return the value of a ROS parameter; None if it does not exist."""
    response = call(master, "getParam", name)
    return response[2] if response is not None and response[0] == 1 else None


def _take_over_required(config: Any) -> set[str]:
    """Return the names of the nodes that a roslaunch configuration marks as required, and remove these marks.

    The names are those of roslaunch's processes, such as hric/safety/supervisor.

    With the mark, roslaunch reports even a normal end of the node as an error.
    """
    required = {node for node in config.nodes if node.required}
    for node in required:
        node.required = False
    return {rosgraph.names.ns_join(node.namespace, node.name).strip("/") for node in required}


def _wait(parent: Any, nodes: RequiredNodes, request: ShutdownRequest, ready: Callable[[], str | None]) -> None:
    """Wait until a required node ends or a shutdown is requested; print a message when all nodes are ready."""
    shown, look = False, time.monotonic()
    while not (request.count or nodes.exit_text):
        time.sleep(0.02)
        if parent.pm.done and not nodes.exit_text:  # roslaunch has ended all nodes, as its master died
            nodes.code, nodes.exit_text = FAILURE, f"the ROS master at {os.environ['ROS_MASTER_URI']} does not respond"
        if not shown and time.monotonic() >= look:
            look = time.monotonic() + PERIOD
            if text := ready():
                shown = True
                print(f"\n{text}\n", flush=True)


def _code(nodes: RequiredNodes, is_experiment: bool) -> int:
    if not nodes.exit_text:
        return INTERRUPTED if is_experiment else 0
    if nodes.code:
        print(f"scripts/bringup: {nodes.exit_text}; its messages are above", file=sys.stderr)
    return nodes.code if nodes.code >= 0 else 128 - nodes.code


def main(argv: list[str]) -> int:
    """Run the command and return its exit code."""
    try:
        known, defaults = given.choices(), {name: default for name, (default, _) in given.documented().items()}
        arguments = defaults | given.check(given.split(argv), defaults, known)
        check_realism(arguments["realism"])
        if arguments["experiment"].endswith((".yaml", ".yml")):
            import hric_run.definition.experiment  # reports all mistakes of the file in one error

            hric_run.definition.experiment.load(arguments["experiment"])
        if arguments["env"] == "real" and arguments["robot"] == given.UR5E:
            import ur_robot.connection

            ur_robot.connection.probe(arguments["robot_ip"], PROBE_TIMEOUT)
        elif arguments["env"] == "real" and arguments["robot_ip"] != given.EMULATED:
            # imported here, since it loads libfranka, which a simulated arm does not need
            import franka_real.probe

            franka_real.probe.check(arguments["robot_ip"], PROBE_TIMEOUT)
        blind = arguments["rviz"] == "auto" and resolve_rviz("auto") == "false"
        if arguments["view"] == "auto" and (blind or arguments["control"] == "true"):
            arguments["view"] = "web"
        arguments["rviz"] = resolve_rviz(arguments["rviz"])
        arguments["mocap"] = given.device("mocap", arguments, known)
        shown = arguments | {name: given.device(name, arguments, known) for name in given.DEVICES}
        master, running = choose(os.environ.get("ROS_MASTER_URI") or DEFAULT, f"{namespace(arguments)}/robot")
    except (MasterError, HricError) as error:
        print(f"scripts/bringup: {error}", file=sys.stderr)
        return getattr(error, "exit_code", FAILURE)
    announce(shown, master, running)
    return run(arguments, master)


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    # All processes have ended; do not wait for roslaunch's threads.
    os._exit(code)
