"""Command-line tools `spawner` and `unspawner`: controllers are started or stopped while the tool runs."""

import argparse
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import Bool

from controller_manager_msgs.srv import SwitchControllerRequest
from hric_control.manager.client import ManagerClient, check_master
from hric_core.errors import HricError
from hric_core.parameters import read_yaml
from hric_core.processes import run_command
from hric_core.ros import RosNode
from hric_core.ros.process import check_private, refuse_unread


def spawner_parser() -> argparse.ArgumentParser:
    """Return the command-line parser of `spawner`."""
    parser = _parser(
        "spawner",
        "Load and start controllers; stop and unload them when this program ends.",
        "a controller's name, or a YAML file with the configuration of controllers",
    )
    parser.add_argument("--stopped", action="store_true", help="load the controllers, but do not start them")
    parser.add_argument(
        "--wait-for", metavar="TOPIC", default="", help="first wait for a message True on this topic (std_msgs/Bool)"
    )
    return parser


def unspawner_parser() -> argparse.ArgumentParser:
    """Return the command-line parser of `unspawner`."""
    text = "Stop controllers and keep them stopped; start them again when this program ends."
    return _parser("unspawner", text, "a controller's name")


def _parser(tool: str, text: str, controllers: str) -> argparse.ArgumentParser:
    """Return a parser with the arguments of both tools; `controllers`: help text for the names."""
    parser = argparse.ArgumentParser(prog=tool, description=text)
    parser.add_argument("controllers", nargs="+", metavar="controller", help=controllers)
    parser.add_argument(
        "--namespace", metavar="NS", default="", help="namespace of the robot, which contains controller_manager"
    )
    parser.add_argument(
        "--timeout", metavar="T", type=float, default=30.0, help="longest wait for the services [s] (default: 30)"
    )
    parser.add_argument("--no-timeout", action="store_true", help="wait for the services without a limit")
    parser.add_argument(
        "--shutdown-timeout",
        metavar="T",
        type=float,
        default=2.0,
        help="longest time for the clean-up when the program ends [s] (default: 2)",
    )
    return parser


class Spawner:
    """Work of the tool `spawner`: loads and starts controllers, and unloads them at the end.

    `down` may be called from another thread while `up` is running."""

    def __init__(self, client: ManagerClient) -> None:
        self._client = client
        self._loaded: list[str] = []
        self._started: list[str] = []
        # A request and the recording of its result are one step; otherwise an end in between would leave a controller
        # loaded.
        self._step = threading.Lock()
        self._ended = False

    def up(self, names: Sequence[str], start: bool) -> None:
        """Load controllers, and start them in one STRICT switch.

        A controller that is loaded already is used unchanged, and remains loaded when the spawner ends.

        Raises:
            HricError: a request was refused, or `down` was called meanwhile; the controllers that this call has loaded
                are unloaded again.
        """
        states = {controller.name: controller.state for controller in self._client.list()}
        try:
            for name in names:
                if name in states:
                    rospy.logwarn("controller %s is loaded already: it is used as it is", name)
                    continue
                with self._request():
                    self._client.load(name)
                    self._loaded.append(name)
            stopped = [name for name in names if states.get(name) != "running"] if start else []
            if stopped:
                with self._request():
                    self._client.switch(stopped, [])
                    self._started.extend(stopped)
        except HricError:
            self.down()
            raise
        rospy.loginfo(
            "controllers loaded: %s; started: %s", ", ".join(self._loaded) or "none", ", ".join(self._started) or "none"
        )

    def down(self) -> None:
        """Stop and unload the controllers that `up` has started and loaded; `up` makes no further request."""
        self._ended = True  # set before the lock is free, as `up` might be the first to acquire it again
        with self._step:
            if self._started:
                self._client.switch([], self._started, SwitchControllerRequest.BEST_EFFORT)
                self._started.clear()
            while self._loaded:
                self._client.unload(self._loaded.pop())

    @contextmanager
    def _request(self) -> Iterator[None]:
        with self._step:
            if self._ended:
                raise HricError("interrupted before all controllers were loaded and started")
            yield


class Unspawner:
    """Work of the tool `unspawner`: stops controllers, and starts them again at the end.

    `release` may be called from another thread while `hold` is running."""

    def __init__(self, client: ManagerClient, names: Sequence[str]) -> None:
        self._client, self._names = client, names
        self._stopped: list[str] = []
        self._step = threading.Lock()  # `release` during a switch must know which controllers were stopped by it
        self._ended = False

    def hold(self) -> None:
        """Stop those of the named controllers that are running; do nothing after `release`."""
        with self._step:
            if self._ended:
                return
            running = [
                controller.name
                for controller in self._client.list()
                if controller.name in self._names and controller.state == "running"
            ]
            if running:
                self._client.switch([], running, SwitchControllerRequest.BEST_EFFORT)
                rospy.loginfo("controllers stopped: %s", ", ".join(running))
                self._stopped.extend(name for name in running if name not in self._stopped)

    def release(self) -> None:
        """Start the controllers again that `hold` has stopped."""
        with self._step:
            self._ended = True
            if self._stopped:
                self._client.switch(self._stopped, [], SwitchControllerRequest.BEST_EFFORT)
                self._stopped.clear()


def run_spawner(argv: Sequence[str]) -> int:
    """Run the program `spawner` and return its exit code.

    Args:
        argv: command line without the program's name; ROS arguments are allowed.
    """
    args = read_words(spawner_parser(), argv)

    def work() -> None:
        controllers = dict(pair for argument in args.controllers for pair in _controllers(argument).items())
        client = _connect("spawner", args)
        if args.wait_for:
            _wait_for_true(args.wait_for)
        for name, configuration in controllers.items():
            if configuration is not None:
                prefix = f"{args.namespace.rstrip('/')}/" if args.namespace else ""
                rospy.set_param(rospy.resolve_name(prefix + name), configuration)
        spawner = Spawner(client)
        rospy.on_shutdown(lambda: _bounded(spawner.down, args.shutdown_timeout))
        spawner.up(list(controllers), start=not args.stopped)
        rospy.spin()

    return run_tool("spawner", work)


def run_unspawner(argv: Sequence[str]) -> int:
    """Run the program `unspawner` and return its exit code."""
    args = read_words(unspawner_parser(), argv)

    def work() -> None:
        unspawner = Unspawner(_connect("unspawner", args), args.controllers)
        rospy.on_shutdown(lambda: _bounded(unspawner.release, args.shutdown_timeout))
        while not rospy.is_shutdown():
            unspawner.hold()
            rospy.rostime.wallsleep(1.0)

    return run_tool("unspawner", work)


def read_words(parser: argparse.ArgumentParser, argv: Sequence[str]) -> argparse.Namespace:
    """Parse the command line of a tool, which may contain ROS arguments; exit with an error for _PARAMETER:=VALUE."""
    check_private(parser.prog, words=argv)
    return parser.parse_args(rospy.myargv([parser.prog, *argv])[1:])


def run_tool(name: str, work: Callable[[], None]) -> int:
    """Run the work of a tool and return the exit code: 0 also after Ctrl-C or a shutdown request.

    A HricError is printed as one line on stderr."""

    def until_shutdown() -> None:
        try:
            work()
        except (HricError, rospy.ROSInterruptException) as error:
            if isinstance(error, HricError) and not rospy.core.is_shutdown_requested():
                raise

    return run_command(name, until_shutdown, interrupted=0)


def _connect(name: str, args: argparse.Namespace) -> ManagerClient:
    check_master()
    rospy.init_node(name, anonymous=True, disable_signals=True)
    refuse_unread(RosNode("~"), ())
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    client = ManagerClient(args.namespace)
    client.wait(None if args.no_timeout else args.timeout, rospy.loginfo)
    return client


def _end(*_: Any) -> None:
    """Handle a signal by a shutdown in another thread.

    rospy's own handler would interrupt the main thread, and may wait for a lock that the main thread holds."""
    threading.Thread(target=rospy.signal_shutdown, args=("signal",)).start()


def _wait_for_true(topic: str) -> None:
    received = threading.Event()

    def receive(message: Any) -> None:
        if message.data:
            received.set()

    subscriber = rospy.Subscriber(topic, Bool, receive)
    while not received.wait(0.1):
        if rospy.is_shutdown():
            raise HricError(f"interrupted while waiting for True on {topic}")
        if not rospy.core.is_shutdown_requested():
            rospy.loginfo_throttle(5.0, f"waiting for True on {rospy.resolve_name(topic)}")
    subscriber.unregister()


def _controllers(argument: str) -> dict[str, object]:
    """Return the configurations in a YAML file by controller name; a plain name is returned with None."""
    path = Path(argument)
    if not path.is_file() and path.suffix not in (".yaml", ".yml"):
        return {argument: None}
    content = read_yaml(path)
    if not isinstance(content, dict) or not content:
        raise HricError(f"{path} must be a mapping of controllers' names to their configurations")
    return {str(name): configuration for name, configuration in content.items()}


def _bounded(work: Callable[[], None], timeout: float) -> None:
    """Run the clean-up for at most `timeout` [s], as the robot may end at the same time and never respond."""

    def run() -> None:
        try:
            work()
        except HricError as error:
            rospy.logwarn("clean-up of the controllers at the end failed: %s", error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(timeout)
